// SPDX-License-Identifier: BSD-3-Clause
#include "scip/request.h"

#include <algorithm>
#include <array>
#include <cstdio>

namespace kurumaisu::scip {
namespace {

constexpr std::size_t kOnceLength = 12;    // GDssssEEEEcc
constexpr std::size_t kStreamLength = 15;  // MDssssEEEEccinn
constexpr std::size_t kCountAt = 13;       // of a stream's number of scans

bool isDigit(char c) { return c >= '0' && c <= '9'; }

int number(std::string_view digits) {
  int value = 0;
  for (const char c : digits) value = 10 * value + (c - '0');
  return value;
}

}  // namespace

int beams(const Request& request) { return (request.last - request.first) / request.cluster + 1; }

int width(Form form) {
  if (form == Form::kShort) return 2;
  return form == Form::kDistance ? 3 : 6;
}

std::string command(const Request& request) {
  std::array<char, 64> text{};
  const int length =
      std::snprintf(text.data(), text.size(), "%c%c%04d%04d%02d", request.stream ? 'M' : 'G',
                    static_cast<char>(request.form), request.first, request.last, request.cluster);
  std::string result(text.data(), static_cast<std::size_t>(length));
  if (!request.stream) return result;
  std::snprintf(text.data(), text.size(), "%01d%02d", request.interval, request.count);
  return result + text.data();
}

std::optional<Request> request(std::string_view command) {
  if (command.size() != kOnceLength && command.size() != kStreamLength) return std::nullopt;
  Request result;
  result.stream = command.size() == kStreamLength;
  const char form = command[1];
  if (command[0] != (result.stream ? 'M' : 'G') || (form != 'D' && form != 'S' && form != 'E'))
    return std::nullopt;
  if (!std::all_of(command.begin() + 2, command.end(), isDigit)) return std::nullopt;
  result.form = static_cast<Form>(form);
  result.first = number(command.substr(2, 4));
  result.last = number(command.substr(6, 4));
  result.cluster = std::max(number(command.substr(10, 2)), 1);
  if (result.stream) {
    result.interval = number(command.substr(12, 1));
    result.count = number(command.substr(kCountAt, 2));
  }
  return result;
}

bool answers(std::string_view echo, const Request& request) {
  const std::string asked = command(request);
  if (!request.stream) return echo == asked;
  return echo.size() == asked.size() && echo.substr(0, kCountAt) == asked.substr(0, kCountAt);
}

}  // namespace kurumaisu::scip
