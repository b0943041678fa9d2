// SPDX-License-Identifier: BSD-3-Clause
#include "scip/message.h"

#include <algorithm>
#include <iterator>

#include "scip/code.h"
#include "scip/request.h"

namespace kurumaisu::scip {
namespace {

constexpr std::size_t kLongest = 1U << 16U;  // [bytes] of a message; 1081 beams with intensity are 6.7 kB
constexpr std::size_t kLongestEcho = 64;     // [bytes], with a string; a longer first line is noise
constexpr std::size_t kLongestString = 16;   // after the semicolon of a command
constexpr std::size_t kLongestMeasurement = 15 + 1 + kLongestString;

std::vector<std::string_view> linesOf(std::string_view block) {
  std::vector<std::string_view> lines;
  for (std::size_t start = 0; start <= block.size();) {
    const std::size_t end = std::min(block.find('\n', start), block.size());
    lines.push_back(block.substr(start, end - start));
    start = end + 1;
  }
  return lines;
}

/// Status of a line: two characters and their sum, or one alone (SCIP 1.1).
std::optional<std::string> statusOf(std::string_view line) {
  if (line.size() == 1) return std::string(line);
  if (line.size() == 3 && sum(line.substr(0, 2)) == line[2]) return std::string(line.substr(0, 2));
  return std::nullopt;
}

/// The echo of a measurement, with its string if it has one, at a line's end; empty if there is none.
std::string_view measurementAtEnd(std::string_view line) {
  if (line.size() > kLongestMeasurement) line.remove_prefix(line.size() - kLongestMeasurement);
  for (; !line.empty(); line.remove_prefix(1)) {
    if (request(line.substr(0, line.find(';')))) return line;
  }
  return {};
}

bool endsWith(std::string_view line, std::string_view end) {
  return !end.empty() && line.size() >= end.size() && line.substr(line.size() - end.size()) == end;
}

/// Could a reply's first line be some command's echo, rather than noise?
bool isEcho(std::string_view line) {
  const auto is_printable = [](char c) { return c >= ' ' && c <= '~'; };
  return !line.empty() && line.size() <= kLongestEcho && std::all_of(line.begin(), line.end(), is_printable);
}

/// VV, PP and II end their lines by a semicolon that is not in the sum.
bool isKeyed(std::string_view command) {
  const std::string_view name = command.substr(0, 2);
  return name == "VV" || name == "PP" || name == "II";
}

bool isGood(std::string_view line, bool keyed) {
  if (line.size() < 2) return false;
  const std::string_view body = line.substr(0, line.size() - 1);
  if (sum(body) == line.back()) return true;
  return keyed && body.back() == ';' && sum(body.substr(0, body.size() - 1)) == line.back();
}

}  // namespace

void Assembler::add(std::string_view bytes, double time) {
  if (bytes.empty()) return;
  arrivals_.emplace_back(dropped_ + buffer_.size(), time);
  buffer_ += bytes;
}

std::optional<Message> Assembler::next() {
  for (;;) {
    while (taken_ < buffer_.size() && buffer_[taken_] == '\n') drop(1);
    const std::string_view window = std::string_view(buffer_).substr(taken_, kLongest + 2);
    const std::size_t end = window.find("\n\n", searched_);
    if (end != std::string_view::npos) {
      std::optional<Message> message = parse(window.substr(0, end));
      drop(end + 2);
      if (!message) continue;
      ++counts_.messages;
      return message;
    }
    if (window.size() < kLongest + 2) {
      searched_ = window.empty() ? 0 : window.size() - 1;
      return std::nullopt;
    }
    ++counts_.unreadable;
    drop(kLongest);
  }
}

void Assembler::clear() {
  dropped_ += buffer_.size();
  buffer_.clear();
  arrivals_.clear();
  taken_ = 0;
  searched_ = 0;
}

std::optional<Message> Assembler::parse(std::string_view block) {
  const std::vector<std::string_view> lines = linesOf(block);
  // Backwards: where a reply's end was lost, the next one is whole.
  for (std::size_t i = lines.size() - 1; i-- > 0;) {
    const std::optional<std::string> status = statusOf(lines[i + 1]);
    if (!status) continue;
    std::string_view echo = measurementAtEnd(lines[i]);
    if (echo.empty() && endsWith(lines[i], expected_)) echo = expected_;
    if (echo.empty() && i == 0 && isEcho(lines[0])) echo = lines[0];
    if (echo.empty()) continue;
    if (i > 0 && statusOf(lines[1])) ++counts_.cut;
    const auto start =
        static_cast<std::size_t>(lines[i].data() + lines[i].size() - echo.size() - block.data());
    counts_.stray_bytes += start;
    Message message{std::string(echo), *status, {}, 0, timeOf(start)};
    const std::size_t sum_width = status->size() > 1 ? 1 : 0;  // SCIP 1.1 has none
    for (std::size_t k = i + 2; k < lines.size(); ++k) {
      if (sum_width > 0 && !isGood(lines[k], isKeyed(echo))) ++message.bad_sums;
      message.lines.emplace_back(lines[k].substr(0, lines[k].size() - std::min(sum_width, lines[k].size())));
    }
    counts_.bad_sums += static_cast<std::uint64_t>(message.bad_sums);
    return message;
  }
  ++counts_.unreadable;
  return std::nullopt;
}

double Assembler::timeOf(std::size_t position) const {
  const auto later = [](std::uint64_t at, const auto& arrival) { return at < arrival.first; };
  const std::uint64_t at = dropped_ + taken_ + position;
  return std::prev(std::upper_bound(arrivals_.begin(), arrivals_.end(), at, later))->second;
}

void Assembler::drop(std::size_t bytes) {
  taken_ += bytes;
  searched_ = 0;
  while (arrivals_.size() > 1 && arrivals_[1].first <= dropped_ + taken_) arrivals_.pop_front();
  if (2 * taken_ < buffer_.size())
    return;  // to move the rest for every short message would take quadratic time
  buffer_.erase(0, taken_);
  dropped_ += taken_;
  taken_ = 0;
}

}  // namespace kurumaisu::scip
