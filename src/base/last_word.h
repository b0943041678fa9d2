// SPDX-License-Identifier: BSD-3-Clause
// Neutral, when the program ends by std::terminate: an exception that nobody catches, or in a thread of a library.
#pragma once

#include <functional>

namespace kurumaisu {

/// While it lives, std::terminate first does this, then aborts. One at a time. What is done must not wait long;
/// it may run in any thread, over data in any state.
class LastWord {
 public:
  explicit LastWord(std::function<void()> word);
  LastWord(const LastWord&) = delete;
  LastWord& operator=(const LastWord&) = delete;
  ~LastWord();
};

}  // namespace kurumaisu
