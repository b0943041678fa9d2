// SPDX-License-Identifier: BSD-3-Clause
// rosrun kurumaisu virtual_dac DEVICE.yaml LINK: be the board that a device's file describes.
#include <sched.h>
#include <sys/mman.h>

#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "dac/virtual_board.h"

namespace {

using kurumaisu::dac::VirtualBoard;

constexpr const char* kUsage =
    "virtual_dac DEVICE.yaml LINK [--log FILE] [--realtime] [FAULT]...\n\n"
    "A serial D/A board at a terminal to which LINK leads, as the file describes it (its `port` is not "
    "read), until its\n"
    "standard input ends. It reads faults from there, one per line, and answers `volts`.\n\n"
    "  --log FILE   every change of voltage: TIME volts V_f V_s V_ref, TIME in ns of CLOCK_MONOTONIC\n"
    "  --realtime   before all others, where the system allows it\n"
    "  FAULT        NAME[@COMMAND][xCOUNT][=SECONDS]; without COMMAND it begins at once\n\n";

struct Options {
  std::vector<std::string> places;  // device, link
  std::vector<std::string> faults;
  std::string log;
  bool realtime = false;
};

Options optionsOf(const std::vector<std::string>& arguments) {
  Options options;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == "--realtime") {
      options.realtime = true;
    } else if (arguments[i] == "--log" && i + 1 < arguments.size()) {
      options.log = arguments[++i];
    } else if (options.places.size() < 2) {
      options.places.push_back(arguments[i]);
    } else {
      options.faults.push_back(arguments[i]);
    }
  }
  return options;
}

/// Later than others, it would measure itself.
void goFirst() {
  const sched_param priority{sched_get_priority_max(SCHED_FIFO)};
  if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) std::perror("--realtime");
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) std::perror("--realtime");
}

void obey(VirtualBoard& board, const std::string& line) {
  if (line == "volts") {
    const auto volts = board.volts();
    std::printf("%.6f %.6f %.6f\n", volts.translation, volts.steering, volts.reference);
  } else {
    try {
      board.inject(line);
      std::printf("%s\n", line.c_str());
    } catch (const std::exception& error) {
      std::printf("%s\n", error.what());
    }
  }
  std::fflush(stdout);
}

int run(const Options& options) {
  if (options.realtime) goFirst();
  VirtualBoard board(kurumaisu::dac::readDevice(options.places[0]), options.places[1], options.log);
  for (const std::string& fault : options.faults) board.inject(fault);
  std::printf("a virtual board at %s\n", options.places[1].c_str());
  std::fflush(stdout);
  for (std::string line; std::getline(std::cin, line);) obey(board, line);
  std::printf("%zu changes, %lu commands, %lu not understood\n", board.history().size(),
              static_cast<unsigned long>(board.commands()), static_cast<unsigned long>(board.misheard()));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = optionsOf({argv + 1, argv + argc});
  if (options.places.size() != 2) {
    std::fputs((kUsage + kurumaisu::dac::boardFaults()).c_str(), stderr);
    return 2;
  }
  try {
    return run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "virtual_dac: %s\n", error.what());
    return 1;
  }
}
