// SPDX-License-Identifier: BSD-3-Clause
// Replies written and read from the specification once more, slowly, and with nothing of src/scip: an oracle for it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace frames {

/// A scan as it was set or read: clock [ms], and for each beam its numbers (one, or distance and intensity).
struct Scan {
  std::uint32_t clock = 0;
  std::vector<std::uint32_t> numbers;

  bool operator==(const Scan& other) const { return clock == other.clock && numbers == other.numbers; }
};

/// The line with its sum and its LF.
inline std::string line(const std::string& body) {
  int total = 0;
  for (const unsigned char c : body) total = (total + c) % 64;
  return body + std::string(1, static_cast<char>('0' + total)) + "\n";
}

inline std::string number(std::uint32_t value, int characters) {
  std::string text;
  for (int place = characters - 1; place >= 0; --place)
    text += static_cast<char>('0' + (value >> (6 * place)) % 64);
  return text;
}

/// A whole reply: echo, status, and body lines without their sums.
inline std::string reply(const std::string& echo, const std::string& status,
                         const std::vector<std::string>& lines = {}) {
  std::string text = echo + "\n" + line(status);
  for (const std::string& body : lines) text += line(body);
  return text + "\n";
}

/// Characters of each number of a command's data: 2 for MS and GS, else 3.
inline int widthOf(const std::string& command) { return command[1] == 'S' ? 2 : 3; }

/// A whole reply that holds a scan.
inline std::string scan(const std::string& command, const Scan& scan) {
  std::string data;
  for (const std::uint32_t value : scan.numbers) data += number(value, widthOf(command));
  std::vector<std::string> lines{number(scan.clock, 4)};
  for (std::size_t at = 0; at < data.size(); at += 64) lines.push_back(data.substr(at, 64));
  return reply(command, command[0] == 'M' ? "99" : "00", lines);
}

/// Reads one reply to a command, from the first byte of its echo to its two LFs; none if a byte of it is wrong.
inline std::optional<Scan> read(const std::string& text, const std::string& command, std::size_t numbers) {
  const std::string head = command + "\n" + line(command[0] == 'M' ? "99" : "00");
  if (text.compare(0, head.size(), head) != 0 || text.size() < head.size() + 7) return std::nullopt;
  Scan result;
  std::string data;
  for (std::size_t at = head.size(); text[at] != '\n';) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos || end + 1 >= text.size()) return std::nullopt;
    const std::string body = text.substr(at, end - at - 1);
    if (line(body) != text.substr(at, end + 1 - at)) return std::nullopt;
    data += body;
    at = end + 1;
  }
  for (const char c : data) {
    if (c < '0' || c > 'o') return std::nullopt;
  }
  const std::size_t width = static_cast<std::size_t>(widthOf(command));
  if (data.size() != 4 + numbers * width) return std::nullopt;
  const auto value = [&](std::size_t at, std::size_t characters) {
    std::uint32_t total = 0;
    for (std::size_t k = at; k < at + characters; ++k)
      total = 64 * total + static_cast<std::uint32_t>(data[k] - '0');
    return total;
  };
  result.clock = value(0, 4);
  for (std::size_t k = 0; k < numbers; ++k) result.numbers.push_back(value(4 + k * width, width));
  // The lengths of the lines, too: what is read must be what a sensor would have written.
  return text == scan(command, result) ? std::optional(result) : std::nullopt;
}

}  // namespace frames
