// SPDX-License-Identifier: BSD-3-Clause
// rosrun kurumaisu set_voltages DEVICE.yaml V_F V_S V_REF: try a device's file with a voltmeter, without a chair.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "command_line.h"
#include "dac/open.h"
#include "signals.h"
#include "standard_streams.h"

namespace {

namespace dac = kurumaisu::dac;

constexpr const char* kHelp = R"(usage: set_voltages DEVICE.yaml V_F V_S V_REF

Puts out three voltages until Enter or a signal, Ctrl-C for example, then
neutral: to try a D/A converter with a voltmeter. It has no guard: never connect
a chair!

  DEVICE.yaml    the D/A converter: launch/dac holds examples
  V_F V_S V_REF  [V]; V_F and V_S count from the reference V_REF

Prints what the device holds. Exit code: 1 a failure, 2 wrong usage.
More: docs/dac.md
)";

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

void run(const std::string& device, const dac::Volts& volts) {
  const kurumaisu::Signals signals;
  std::array<pollfd, 2> ends{{{signals.fd(), POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}}};
  const auto converter = dac::openAndPrepare(dac::readDevice(device));
  std::fprintf(stderr, "%s\n", converter->name().c_str());
  put(*converter, {0, 0, volts.reference});
  put(*converter, volts);
  do {
    poll(ends.data(), ends.size(), -1);
  } while (ends[1].revents == 0 && !signals.nextToEnd());
  put(*converter, {0, 0, volts.reference});
}

}  // namespace

int main(int argc, char** argv) {
  kurumaisu::holdStandardStreams();
  const std::vector<std::string> arguments = kurumaisu::wordsOf(argc, argv);
  if (std::any_of(arguments.begin(), arguments.end(), kurumaisu::isHelp)) {
    std::fputs(kHelp, stdout);
    return 0;
  }
  if (arguments.size() != 4)
    return kurumaisu::misused("set_voltages: a file and three voltages are needed", kHelp);
  dac::Volts volts{};
  try {
    volts = {numberOf(arguments[1]), numberOf(arguments[2]), numberOf(arguments[3])};
  } catch (const std::invalid_argument& error) {
    return kurumaisu::misused(std::string("set_voltages: ") + error.what(), kHelp);
  }
  try {
    run(arguments[0], volts);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "set_voltages: %s\n", error.what());
    return 1;
  }
}
