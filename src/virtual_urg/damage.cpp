// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/damage.h"

#include <algorithm>

namespace kurumaisu::virtual_urg {
namespace {

constexpr int kCodes = 20;                // distances below are codes
constexpr std::size_t kNoise = 24;        // [bytes] unless the fault says how many
constexpr std::size_t kDataLine = 3;      // after echo, status and time stamp
constexpr std::size_t kStatusLength = 3;  // with its sum
constexpr std::size_t kEndLength = 2;     // LF LF

std::size_t startOfLine(const std::string& frame, std::size_t line) {
  std::size_t at = 0;
  for (; line > 0; --line) at = frame.find('\n', at) + 1;
  return at;
}

void corrupt(std::string& frame) {
  const std::size_t at = startOfLine(frame, kDataLine);
  if (at < frame.size()) frame[at] = frame[at] == '0' ? '1' : '0';
}

/// No LF among it: that would be an empty message, and no noise.
std::string noise(std::size_t bytes) {
  constexpr char kBytes[] = {'\x00', '\xff', '~', 'M', 'D', '\r', '9', '9', 'b', '\x7f', '\x80', ';'};
  std::string text;
  while (text.size() < bytes) text += kBytes[text.size() % sizeof(kBytes)];
  return text;
}

}  // namespace

Steps mismeasured(Steps steps, const Faults& faults, int scan) {
  const bool is_zero = faults.find("zeros", scan) != nullptr;
  const bool is_code = faults.find("codes", scan) != nullptr;
  if (!is_zero && !is_code) return steps;
  int step = 0;
  for (int& distance : steps.distances) distance = is_zero ? 0 : step++ % kCodes;
  return steps;
}

std::string damaged(std::string frame, const Faults& faults, int scan) {
  if (faults.find("corrupt", scan) != nullptr) corrupt(frame);
  if (faults.find("badlf", scan) != nullptr) frame[startOfLine(frame, 1) + kStatusLength] = 'x';
  if (faults.find("trunc", scan) != nullptr) frame.resize(frame.size() / 2);
  if (faults.find("noend", scan) != nullptr) frame.resize(frame.size() - std::min(frame.size(), kEndLength));
  const Fault* garbage = faults.find("garbage", scan);
  if (garbage != nullptr) {
    constexpr double kMost = 1 << 20;
    const double asked = std::min(garbage->value.value_or(kNoise), kMost);
    frame.insert(0, noise(static_cast<std::size_t>(asked)));
  }
  return faults.find("dup", scan) != nullptr ? frame + frame : frame;
}

std::string statusAt(const Faults& faults, int scan) {
  for (const Fault& fault : faults.all()) {
    if (fault.name.substr(0, 3) != "err") continue;
    const double after = scan - fault.scan.value_or(scan);
    if (after >= 0 && (!fault.scan || after < fault.value.value_or(1))) return fault.name.substr(3);
  }
  return "";
}

}  // namespace kurumaisu::virtual_urg
