// SPDX-License-Identifier: BSD-3-Clause
// guard: owns the D/A converter. A sentinel and its child; or, with --neutral, one write when both are dead.
#include <algorithm>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dac/open.h"
#include "guard/log.h"
#include "guard/realtime.h"
#include "guard/sentinel.h"
#include "guard/settings.h"

namespace {

namespace k = kurumaisu;

constexpr const char* kUsage =
    "guard [--neutral] DEVICE.yaml GUARD.yaml\n"
    "Keeps the D/A converter of DEVICE.yaml neutral unless a client, over the socket of GUARD.yaml, may "
    "drive.\n"
    "--neutral: only writes neutral and ends; for systemd's ExecStopPost.\n"
    "Exit status: 0 ended by a signal, neutral; 1 a failure; 2 wrong usage.\n";

int run(const std::string& device_file, const std::string& guard_file, bool only_neutral) {
  const k::dac::Device device = k::dac::readDevice(device_file);
  const k::guard::Settings settings = k::guard::readSettings(guard_file);
  const auto open = [&device] { return k::dac::open(device); };
  if (!only_neutral) return k::guard::runSentinel(settings, open);
  k::guard::makeRealtime(settings.priority);
  return k::guard::forceNeutral(settings, open, settings.neutral_patience) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  const auto given = [](const std::string& word) { return word.find(":=") != std::string::npos; };
  words.erase(std::remove_if(words.begin(), words.end(), given), words.end());  // roslaunch names every node
  if (words.size() == 1 && (words[0] == "--help" || words[0] == "-h")) {
    std::cout << kUsage;
    return 0;
  }
  const bool only_neutral = !words.empty() && words[0] == "--neutral";
  if (only_neutral) words.erase(words.begin());
  if (words.size() != 2 || words[0].rfind("--", 0) == 0) {
    std::cerr << kUsage;
    return 2;
  }
  try {
    return run(words[0], words[1], only_neutral);
  } catch (const std::exception& error) {
    k::guard::say("GUARD_FAILED", error.what());
    return 1;
  }
}
