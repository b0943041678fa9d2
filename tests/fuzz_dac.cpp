// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer's target for what reads a D/A board's bytes. An input is what the board says after the first command, after
// the second, ..., parted by bytes 0xFF; its first byte says into what pieces that is cut. Every command has a reply of
// its own, "OK 1" to the first, so that whose reply a line is can be seen without any state.
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "dac/converter.h"
#include "dac/dialogue.h"
#include "fuzzing.h"

namespace d = kurumaisu::dac;
using fuzzing::require;

namespace {

constexpr double kTimeout = 2e-5;  // [s] without bytes: all that come are there at once
constexpr double kLate = 1e3;      // [s] longer than an input lasts: nothing owed is ever forgotten
constexpr std::size_t kCommandsMost = 8;
constexpr std::size_t kLineMost = 256;  // [bytes] a longer one may be cut

using Texts = std::vector<std::string>;

Texts parted(const std::string& text, char end) {
  Texts parts(1);
  for (const char character : text) {
    if (character == end) {
      parts.emplace_back();
    } else {
      parts.back() += character;
    }
  }
  return parts;
}

class Board : public kurumaisu::serial::Port {
 public:
  Board(Texts says, std::size_t piece) : says_(std::move(says)), piece_(piece) {}

  std::size_t read(char* buffer, std::size_t size, double /*timeout*/) override {
    const std::size_t count = std::min({size, piece_, pending_.size()});
    pending_.copy(buffer, count);
    pending_.erase(0, count);
    return count;
  }

  void write(std::string_view bytes, double /*timeout*/) override {
    require(bytes == std::to_string(++commands_) + "\r", "another command than was asked for");
    if (commands_ <= says_.size()) pending_ += says_[commands_ - 1];
  }

  bool hasBaud() const override { return false; }
  void setBaud(int /*baud*/) override {}

 private:
  Texts says_;
  std::size_t piece_;
  std::size_t commands_ = 0;
  std::string pending_;
};

std::string replyTo(std::size_t command) { return "OK " + std::to_string(command); }

/// What must become of each command, from all that the board ever says.
class Oracle {
 public:
  /// Is the reply to the next command the first line after it, but for replies to earlier ones, each of which was missed
  /// and may come once?
  bool succeeds(const std::string& says) {
    ++command_;
    for (const std::string& line : unread_) forgive(line);
    unread_ = parted(says, '\n');
    unread_.pop_back();  // without an end it is no line
    while (!unread_.empty()) {
      const std::string line = unread_.front();
      unread_.erase(unread_.begin());
      if (line == replyTo(command_)) return true;
      if (!forgive(line)) break;
    }
    missed_.push_back(replyTo(command_));
    return false;
  }

 private:
  bool forgive(const std::string& line) {
    const auto found = std::find(missed_.begin(), missed_.end(), line);
    if (found == missed_.end()) return false;
    missed_.erase(found);
    return true;
  }

  std::size_t command_ = 0;
  Texts missed_;
  Texts unread_;
};

bool hasLongLine(const std::string& says) {
  const Texts lines = parted(says, '\n');
  return std::any_of(lines.begin(), lines.end(),
                     [](const std::string& line) { return line.size() > kLineMost; });
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  Texts says = parted({reinterpret_cast<const char*>(data) + 1, size - 1}, '\xff');
  says.resize(std::min(says.size(), kCommandsMost));
  d::Dialogue dialogue(std::make_unique<Board>(says, 1U + data[0] % 64U),
                       d::Manner{"\r", "\n", kTimeout, kLate, 0});
  Oracle oracle;
  bool is_known = true;  // what the oracle says
  for (std::size_t command = 1; command <= says.size(); ++command) {
    bool succeeds = true;
    try {
      require(dialogue.ask(std::to_string(command), replyTo(command)) == replyTo(command), "another's reply");
    } catch (const d::Fault&) {
      succeeds = false;
    }
    is_known = is_known && !hasLongLine(says[command - 1]);
    require(!is_known || succeeds == oracle.succeeds(says[command - 1]),
            "what is no reply, or a reply that is none");
    require(dialogue.inDoubt(replyTo(command)) != succeeds, "what is missing is owed");
  }
  return 0;
}
