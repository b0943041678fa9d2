// SPDX-License-Identifier: BSD-3-Clause
#include "base/last_word.h"

#include <atomic>
#include <cstdlib>
#include <exception>
#include <utility>

namespace kurumaisu {
namespace {

std::function<void()> last_word;
std::atomic<bool> has_word{false};

[[noreturn]] void sayAndAbort() {
  if (has_word.exchange(false)) {  // once, even if it ends here again
    try {
      last_word();
    } catch (...) {  // nothing is left to be done
    }
  }
  std::abort();
}

}  // namespace

LastWord::LastWord(std::function<void()> word) {
  last_word = std::move(word);
  has_word = true;
  std::set_terminate(sayAndAbort);
}

LastWord::~LastWord() { has_word = false; }

}  // namespace kurumaisu
