// SPDX-License-Identifier: BSD-3-Clause
#include "dac/dialogue.h"

#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <utility>

#include "dac/converter.h"

namespace kurumaisu::dac {
namespace {

constexpr std::size_t kReplyMost = 256;  // [bytes]
constexpr int kLinesMost = 1000;         // unasked, at once
constexpr double kSendTimeout = 0.05;    // [s] to hand a frame to the system

bool matches(const std::string& line, const std::string& pattern) {
  return line.find('\0') == std::string::npos && fnmatch(pattern.c_str(), line.c_str(), FNM_NOESCAPE) == 0;
}

/// Can one line match both? Says yes where it does not know.
bool overlap(const std::string& one, const std::string& other) {
  const auto is_pattern = [](const std::string& text) {
    return text.find_first_of("*?[") != std::string::npos;
  };
  return is_pattern(one) || is_pattern(other)
             ? matches(one, other) || matches(other, one) || (is_pattern(one) && is_pattern(other))
             : one == other;
}

}  // namespace

std::string readable(const std::string& text) {
  std::string result;
  for (const char character : text) {
    const auto byte = static_cast<unsigned char>(character);
    if (byte < 0x20 || byte > 0x7e) {
      std::array<char, 8> code{};
      std::snprintf(code.data(), code.size(), "\\x%02X", byte);
      result += code.data();
    } else {
      result += character;
    }
  }
  return '"' + result + '"';
}

Dialogue::Dialogue(std::unique_ptr<serial::Port> port, Manner manner)
    : port_(std::move(port)), manner_(std::move(manner)) {}

void Dialogue::send(const std::string& command) { port_->write(command + manner_.terminator, kSendTimeout); }

void Dialogue::owe(const std::string& expect, double sent) {
  owed_.push_back({expect, sent + manner_.late_reply});
}

/// The next whole line, without its end.
std::optional<std::string> Dialogue::next(double until) {
  for (;;) {
    const std::size_t end = input_.find(manner_.reply_terminator);
    if (end != std::string::npos) {
      std::string line = input_.substr(0, end);
      input_.erase(0, end + manner_.reply_terminator.size());
      return line;
    }
    if (input_.size() > kReplyMost) return std::exchange(input_, "");
    std::array<char, kReplyMost> bytes;
    const std::size_t count = port_->read(bytes.data(), bytes.size(), std::max(0.0, until - steadyTime()));
    input_.append(bytes.data(), count);
    if (count == 0 && steadyTime() >= until) return std::nullopt;
  }
}

/// Is a line a reply that was owed? Then it no longer is.
bool Dialogue::settled(const std::string& line) {
  const auto found = std::find_if(owed_.begin(), owed_.end(),
                                  [&line](const Owed& owed) { return matches(line, owed.expect); });
  if (found == owed_.end()) return false;
  owed_.erase(found);
  return true;
}

/// What has come unasked, or too late, answers nothing.
void Dialogue::discard() {
  int lines = 0;
  while (const std::optional<std::string> line = next(0)) {
    settled(*line);
    if (++lines > kLinesMost) throw Fault("DAC_WRONG_REPLY: the reply does not end");
  }
  input_.clear();
  const double now = steadyTime();
  owed_.erase(
      std::remove_if(owed_.begin(), owed_.end(), [now](const Owed& owed) { return owed.until <= now; }),
      owed_.end());
}

bool Dialogue::inDoubt(const std::string& expect) const {
  const double now = steadyTime();
  return std::any_of(owed_.begin(), owed_.end(),
                     [&](const Owed& owed) { return owed.until > now && overlap(owed.expect, expect); });
}

void Dialogue::settle() {
  for (;;) {
    const double now = steadyTime();
    double until = now;
    for (const Owed& owed : owed_) until = std::max(until, owed.until);
    if (until <= now) break;
    if (const std::optional<std::string> line = next(until)) settled(*line);
  }
  discard();
}

void Dialogue::tell(const std::string& command, const std::string& expect) {
  send(command);
  if (!expect.empty()) owe(expect, steadyTime());
}

bool Dialogue::askAtOnce(const std::vector<Command>& commands) {
  discard();
  if (!owed_.empty()) return false;
  for (const Command& command : commands) tell(command.text, command.expect);
  for (const double until = steadyTime() + manner_.reply_timeout; !owed_.empty();) {
    const std::optional<std::string> line = next(until);
    if (!line || !settled(*line)) return false;
  }
  return true;
}

std::string Dialogue::ask(const std::string& command, const std::string& expect) {
  discard();
  if (inDoubt(expect)) settle();
  std::string wrong;
  for (int attempt = 0; attempt <= manner_.retries; ++attempt) {
    send(command);
    const double sent = steadyTime();
    while (std::optional<std::string> line = next(sent + manner_.reply_timeout)) {
      if (matches(*line, expect)) return *line;
      if (settled(*line)) continue;
      wrong = readable(*line);
      break;
    }
    owe(expect, sent);
  }
  const std::string what = "to " + readable(command) + ", expected: " + readable(expect);
  if (wrong.empty()) throw Fault("DAC_NO_REPLY: no reply " + what);
  throw Fault("DAC_WRONG_REPLY: " + wrong + " is the reply " + what);
}

}  // namespace kurumaisu::dac
