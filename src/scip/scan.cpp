// SPDX-License-Identifier: BSD-3-Clause
#include "scip/scan.h"

#include "scip/code.h"

namespace kurumaisu::scip {
namespace {

constexpr std::size_t kClockWidth = 4;
constexpr std::size_t kLineWidth = 64;     // of data, without the sum
constexpr std::size_t kDistanceWidth = 3;  // of a beam with intensity

/// Every line but the last is full: where characters went from one to another, six bits of sum may not tell.
std::string bodyOf(const Message& message) {
  std::string data;
  for (std::size_t i = 1; i < message.lines.size(); ++i) {
    const std::string& line = message.lines[i];
    if (line.size() > kLineWidth || (line.size() < kLineWidth && i + 1 < message.lines.size())) {
      throw BadFrame("line " + std::to_string(i) + " of the data has " + std::to_string(line.size()) +
                     " characters, not 64");
    }
    data += line;
  }
  return data;
}

}  // namespace

std::uint32_t decodeClock(std::string_view characters) {
  if (characters.size() != kClockWidth) {
    throw BadFrame("a time stamp of " + std::to_string(characters.size()) + " characters, not 4");
  }
  return decode(characters);
}

bool holdsScan(const Message& message) {
  const bool is_stream = !message.command.empty() && message.command[0] == 'M';
  return message.status == (is_stream ? "99" : "00") && !message.lines.empty();
}

Rotation decodeScan(const Message& message, const Request& request) {
  if (!answers(message.command.substr(0, message.command.find(';')), request)) {
    throw BadFrame("a reply to " + message.command + ", not to " + command(request));
  }
  if (!holdsScan(message)) throw BadFrame("status " + message.status);
  if (message.bad_sums > 0) throw BadFrame(std::to_string(message.bad_sums) + " lines with a wrong sum");
  Rotation scan;
  scan.clock = decodeClock(message.lines[0]);
  const std::string data = bodyOf(message);
  const auto count = static_cast<std::size_t>(beams(request));
  const auto step = static_cast<std::size_t>(width(request.form));
  if (data.size() != count * step) {
    throw BadFrame(std::to_string(data.size()) + " characters of data, not " + std::to_string(count * step));
  }
  const bool intense = request.form == Form::kIntensity;
  for (std::size_t at = 0; at < data.size(); at += step) {
    const std::string_view beam = std::string_view(data).substr(at, step);
    scan.distances.push_back(static_cast<int>(decode(beam.substr(0, intense ? kDistanceWidth : step))));
    if (intense) scan.intensities.push_back(static_cast<int>(decode(beam.substr(kDistanceWidth))));
  }
  return scan;
}

}  // namespace kurumaisu::scip
