// SPDX-License-Identifier: BSD-3-Clause
#include "guard/log.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cstdio>

namespace kurumaisu::guard {
namespace {

constexpr std::size_t kLongest =
    1024;  // [bytes] of a line: a pipe that polls writable takes them without blocking

}  // namespace

void say(const std::string& code, const std::string& text) {
  std::string line = code + ": " + text;
  if (line.size() >= kLongest) line.resize(kLongest - 1);
  line += '\n';
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  if (poll(&out, 1, 0) != 1 || (out.revents & POLLOUT) == 0) return;
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, line.data(), line.size());
}

std::string reaction(double noticed, double neutral) {
  std::array<char, 80> text{};
  std::snprintf(text.data(), text.size(), "; noticed at %.6f s, neutral %.3f ms later", noticed,
                1e3 * (neutral - noticed));
  return text.data();
}

}  // namespace kurumaisu::guard
