// SPDX-License-Identifier: BSD-3-Clause
// rosrun kurumaisu virtual_dac DEVICE.yaml PLACE: be the converter that a device's file describes.
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "command_line.h"
#include "dac/virtual/board.h"
#include "dac/virtual/chip.h"
#include "standard_streams.h"

namespace {

using kurumaisu::dac::Device;
using kurumaisu::dac::VirtualBoard;
using kurumaisu::dac::VirtualChip;

constexpr const char* kHelp = R"(usage: virtual_dac DEVICE.yaml PLACE [--log FILE] [--realtime] [FAULT]...

Simulates a D/A converter until Ctrl-C or the end of its standard input, unless
that is /dev/null.

  DEVICE.yaml  the D/A converter: launch/dac holds examples
  PLACE        kind serial: link to make to a terminal, in the place of `port`
               kind iio: folder to make, the file's `root`; its one fault is
               to be unplugged
  --log FILE   every change: TIME volts V_f V_s V_ref; TIME [ns] is
               CLOCK_MONOTONIC
  --realtime   with real-time priority, where the system allows it
  FAULT        NAME[/SIGNAL][@COMMAND][xCOUNT][=SECONDS]; without COMMAND: at
               once

On its standard input it takes a FAULT on each line, and `volts`: print them.
Exit code: 1 a failure, 2 wrong usage. More: docs/dac.md

)";

struct Options {
  std::vector<std::string> places;  // device, place
  std::vector<std::string> faults;
  std::string log;
  bool realtime = false;
  bool help = false;
};

/// Throws std::invalid_argument for a wrong command line.
Options optionsOf(const std::vector<std::string>& arguments) {
  Options options;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (kurumaisu::isHelp(arguments[i])) {
      options.help = true;
    } else if (arguments[i] == "--realtime") {
      options.realtime = true;
    } else if (arguments[i] == "--log" && i + 1 < arguments.size()) {
      options.log = arguments[++i];
    } else if (arguments[i].rfind("--", 0) == 0) {
      throw std::invalid_argument("unknown option, or one without its value: " + arguments[i]);
    } else if (options.places.size() < 2) {
      options.places.push_back(arguments[i]);
    } else {
      options.faults.push_back(arguments[i]);
    }
  }
  if (!options.help && options.places.size() != 2)
    throw std::invalid_argument("a file and a place are needed");
  return options;
}

/// Later than others, it would measure itself.
void goFirst() {
  const sched_param priority{sched_get_priority_max(SCHED_FIFO)};
  if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) std::perror("--realtime");
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) std::perror("--realtime");
}

std::string summaryOf(const VirtualBoard& board) {
  return std::to_string(board.history().size()) + " changes, " + std::to_string(board.commands()) +
         " commands, " + std::to_string(board.misheard()) + " not understood";
}

std::string summaryOf(const VirtualChip& chip) { return std::to_string(chip.changes()) + " changes"; }

template <typename Converter>
void obey(Converter& device, const std::string& line) {
  if (line == "volts") {
    const auto volts = device.volts();
    std::printf("%.6f %.6f %.6f\n", volts.translation, volts.steering, volts.reference);
  } else {
    try {
      device.inject(line);
      std::printf("%s\n", line.c_str());
    } catch (const std::exception& error) {
      std::printf("%s\n", error.what());
    }
  }
  std::fflush(stdout);
}

/// Obeys the lines that have come; false at the end of the input.
template <typename Converter>
bool obeyInput(Converter& device, std::string& input) {
  std::array<char, 512> bytes;
  const ssize_t count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (count <= 0) return false;
  input.append(bytes.data(), static_cast<std::size_t>(count));
  for (std::size_t end = input.find('\n'); end != std::string::npos; end = input.find('\n')) {
    obey(device, input.substr(0, end));
    input.erase(0, end + 1);
  }
  return true;
}

/// Launched by another program it has no input, and goes on.
bool hasInput() {
  struct stat status {};
  return fstat(STDIN_FILENO, &status) == 0 && (!S_ISCHR(status.st_mode) || isatty(STDIN_FILENO) == 1);
}

template <typename Converter>
void waitIn(Converter& device, int signals) {
  std::array<pollfd, 2> ready{{{signals, POLLIN, 0}, {hasInput() ? STDIN_FILENO : -1, POLLIN, 0}}};
  std::string input;
  while (poll(ready.data(), ready.size(), -1) > 0) {
    if (ready[0].revents != 0) return;
    if (ready[1].revents != 0 && !obeyInput(device, input)) return;
  }
}

/// Works until a signal, or the end of the input.
template <typename Converter>
void serve(const Options& options, const Device& file, int signals) {
  Converter device(file, options.places[1], options.log);
  for (const std::string& fault : options.faults) device.inject(fault);
  std::printf("a virtual board at %s\n", options.places[1].c_str());
  std::fflush(stdout);
  waitIn(device, signals);
  std::printf("%s\n", summaryOf(device).c_str());
}

int run(const Options& options) {
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
  const kurumaisu::Descriptor signals(signalfd(-1, &ends, SFD_CLOEXEC));
  if (options.realtime) goFirst();
  const Device file = kurumaisu::dac::readDevice(options.places[0]);
  if (std::holds_alternative<kurumaisu::dac::SerialSettings>(file.back_end)) {
    serve<VirtualBoard>(options, file, signals.get());
  } else {
    serve<VirtualChip>(options, file, signals.get());
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  kurumaisu::holdStandardStreams();
  const std::string help = kHelp + kurumaisu::dac::boardFaults();
  Options options;
  try {
    options = optionsOf(kurumaisu::wordsOf(argc, argv));
  } catch (const std::invalid_argument& error) {
    return kurumaisu::misused(std::string("virtual_dac: ") + error.what(), help);
  }
  if (options.help) {
    std::fputs(help.c_str(), stdout);
    return 0;
  }
  try {
    return run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "virtual_dac: %s\n", error.what());
    return 1;
  }
}
