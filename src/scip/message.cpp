// SPDX-License-Identifier: BSD-3-Clause
#include "scip/message.h"

#include <algorithm>
#include <iterator>

#include "scip/code.h"
#include "scip/request.h"

namespace kurumaisu::scip {
namespace {

constexpr std::size_t kLongest = 1U << 16U;  // [bytes] of a message; 1081 beams with intensity are 6.7 kB

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
  for (std::size_t start = line.find_first_of("MG"); start != std::string_view::npos;
       start = line.find_first_of("MG", start + 1)) {
    const std::string_view rest = line.substr(start);
    if (request(rest.substr(0, rest.find(';')))) return rest;
  }
  return {};
}

bool endsWith(std::string_view line, std::string_view end) {
  return !end.empty() && line.size() >= end.size() && line.substr(line.size() - end.size()) == end;
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
  arrivals_.emplace_back(buffer_.size(), time);
  buffer_ += bytes;
}

std::optional<Message> Assembler::next() {
  for (;;) {
    const std::size_t end = buffer_.find("\n\n", searched_);
    if (end == std::string::npos) {
      searched_ = buffer_.empty() ? 0 : buffer_.size() - 1;
      if (buffer_.size() <= kLongest) return std::nullopt;
      ++counts_.unreadable;
      clear();
      return std::nullopt;
    }
    std::optional<Message> message = parse(std::string_view(buffer_).substr(0, end));
    discard(end + 2);
    if (message) {
      ++counts_.messages;
      return message;
    }
  }
}

void Assembler::clear() {
  buffer_.clear();
  arrivals_.clear();
  searched_ = 0;
}

std::optional<Message> Assembler::parse(std::string_view block) {
  if (block.empty() || block == "\n") return std::nullopt;
  const std::vector<std::string_view> lines = linesOf(block);
  // Backwards: where a reply's end was lost, the next one is whole.
  for (std::size_t i = lines.size() - 1; i-- > 0;) {
    const std::optional<std::string> status = statusOf(lines[i + 1]);
    if (!status) continue;
    std::string_view echo = measurementAtEnd(lines[i]);
    if (echo.empty() && endsWith(lines[i], expected_)) echo = expected_;
    if (echo.empty() && i == 0) echo = lines[0];
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
  const auto later = [](std::size_t at, const auto& arrival) { return at < arrival.first; };
  return std::prev(std::upper_bound(arrivals_.begin(), arrivals_.end(), position, later))->second;
}

void Assembler::discard(std::size_t bytes) {
  const double last = timeOf(bytes - 1);
  buffer_.erase(0, bytes);
  searched_ = 0;
  while (!arrivals_.empty() && arrivals_.front().first < bytes) {
    arrivals_.pop_front();
  }
  for (auto& arrival : arrivals_) arrival.first -= bytes;
  if (!buffer_.empty() && (arrivals_.empty() || arrivals_.front().first > 0))
    arrivals_.emplace_front(0, last);
}

}  // namespace kurumaisu::scip
