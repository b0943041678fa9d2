// SPDX-License-Identifier: BSD-3-Clause
// rosrun kurumaisu set_voltages DEVICE.yaml V_F V_S V_REF: try a device's file with a voltmeter, without a chair.
#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "dac/open.h"

namespace {

namespace dac = kurumaisu::dac;

constexpr const char* kUsage =
    "set_voltages DEVICE.yaml V_F V_S V_REF\n\n"
    "Puts out three voltages [V], V_F and V_S as they are counted from the reference, tells what the device "
    "holds, waits\n"
    "for a line, the end of its input or Ctrl-C, and puts out neutral. For a bench, as it has no guard: "
    "not for a chair!\n";

double numberOf(const std::string& text) {
  double value = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec == std::errc() && result.ptr == text.data() + text.size()) return value;
  throw std::invalid_argument("not a number: " + text);
}

void put(dac::Converter& converter, const dac::Volts& volts) {
  const dac::Volts held = converter.put(volts);
  std::printf("%.6f %.6f %.6f\n", held.translation, held.steering, held.reference);
  std::fflush(stdout);
}

/// From now on Ctrl-C and its like end no program, but a wait. Returns what becomes readable then.
int holdSignals() {
  sigset_t ends;
  sigemptyset(&ends);
  for (const int end : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&ends, end);
  sigprocmask(SIG_BLOCK, &ends, nullptr);
  return signalfd(-1, &ends, SFD_CLOEXEC);
}

void run(const std::vector<std::string>& arguments) {
  const dac::Volts volts{numberOf(arguments[1]), numberOf(arguments[2]), numberOf(arguments[3])};
  std::array<pollfd, 2> ends{{{holdSignals(), POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}}};
  const auto converter = dac::open(dac::readDevice(arguments[0]));
  std::fprintf(stderr, "%s\n", converter->name().c_str());
  put(*converter, {0, 0, volts.reference});
  put(*converter, volts);
  poll(ends.data(), ends.size(), -1);
  put(*converter, {0, 0, volts.reference});
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() != 4) {
    std::fputs(kUsage, stderr);
    return 2;
  }
  try {
    run(arguments);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "set_voltages: %s\n", error.what());
    return 1;
  }
}
