// SPDX-License-Identifier: BSD-3-Clause
// guard: owns the D/A converter. A sentinel and its child; or, with --neutral, one write when both are dead.
#include <algorithm>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "command_line.h"
#include "dac/open.h"
#include "guard/log.h"
#include "guard/realtime.h"
#include "guard/sentinel.h"
#include "guard/settings.h"
#include "standard_streams.h"

namespace {

namespace k = kurumaisu;

constexpr const char* kHelp = R"(usage: guard [--neutral] DEVICE.yaml GUARD.yaml

Keeps the D/A converter neutral unless its client, base_node, may drive. It
needs no ROS.

  DEVICE.yaml  the D/A converter: launch/dac holds examples
  GUARD.yaml   socket, time-outs: launch/guard.yaml
  --neutral    only put out neutral and end; for ExecStopPost of systemd

Exit code: 0 ended by a signal, neutral; 1 a failure; 2 wrong usage.
More: docs/guard.md
)";

int run(const std::string& device_file, const std::string& guard_file, bool only_neutral) {
  const k::dac::Device device = k::dac::readDevice(device_file);
  const k::guard::Settings settings = k::guard::readSettings(guard_file);
  const k::guard::LogWriter log;
  const auto open = [&device] { return k::dac::open(device); };
  if (!only_neutral) return k::guard::runSentinel(settings, open);
  k::guard::makeRealtime(settings.priority);
  return k::guard::forceNeutral(settings, open, settings.neutral_patience) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  k::holdStandardStreams();
  std::vector<std::string> words = k::wordsOf(argc, argv);
  if (std::any_of(words.begin(), words.end(), k::isHelp)) {
    std::cout << kHelp;
    return 0;
  }
  const bool only_neutral = !words.empty() && words[0] == "--neutral";
  if (only_neutral) words.erase(words.begin());
  for (const std::string& word : words) {
    if (word.rfind('-', 0) == 0) return k::misused("guard: unknown option: " + word, kHelp);
  }
  if (words.size() != 2) return k::misused("guard: two files are needed", kHelp);
  try {
    return run(words[0], words[1], only_neutral);
  } catch (const std::exception& error) {
    k::guard::say("GUARD_FAILED", error.what());
    return 1;
  }
}
