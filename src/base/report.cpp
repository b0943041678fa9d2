// SPDX-License-Identifier: BSD-3-Clause
#include "base/report.h"

#include <sstream>

namespace kurumaisu {
namespace {

std::string shown(const Band& band) {
  std::ostringstream out;
  out << "(" << band.low << ", " << band.high << ")";
  return out.str();
}

}  // namespace

std::string ambiguity(const Drive& drive) {
  std::string text;
  const auto say = [&text](const std::string& name, const std::optional<Band>& band) {
    if (!band) return;
    text += (text.empty() ? "" : "; ") + name + " in " + shown(*band) + " V stands for two rates";
  };
  say("V_f", drive.translationBand());
  say("V_s", drive.steeringBand());
  return text;
}

Report reportLaw(const Drive& drive, const std::string& law_name) {
  const std::string warning = ambiguity(drive);
  Report report{!warning.empty(),
                law_name + ": " + (warning.empty() ? "every voltage stands for one rate" : warning),
                {{"voltage law", law_name}}};
  const auto add = [&report](const char* name, const std::optional<Band>& band) {
    report.values.emplace_back(name, band ? shown(*band) : "none");
  };
  add("ambiguous V_f [V]", drive.translationBand());
  add("ambiguous V_s [V]", drive.steeringBand());
  report.values.emplace_back("samples", std::to_string(drive.counts().samples));
  report.values.emplace_back("ambiguous samples", std::to_string(drive.counts().ambiguous));
  return report;
}

Report reportCommands(const Drive& drive, const DriveCounts& before) {
  const DriveCounts& now = drive.counts();
  std::string warning;
  const auto warn = [&warning](bool happened, const char* words) {
    if (happened) warning += (warning.empty() ? "" : "; ") + std::string(words);
  };
  warn(now.refused > before.refused, "command refused");
  warn(now.clamped > before.clamped, "command beyond a limit");
  warn(now.ignored > before.ignored, "command with components that are not obeyed");
  warn(now.timeouts > before.timeouts, "command ran out");
  warn(now.time_resets > before.time_resets, "time ran backwards");
  const char* state = drive.hasCommand() ? "driving by command" : "neutral: no command";
  return {!warning.empty(),
          warning.empty() ? state : warning,
          {{"commands", std::to_string(now.commands)},
           {"refused commands", std::to_string(now.refused)},
           {"clamped commands", std::to_string(now.clamped)},
           {"commands with ignored components", std::to_string(now.ignored)},
           {"timeouts", std::to_string(now.timeouts)},
           {"time resets", std::to_string(now.time_resets)}}};
}

}  // namespace kurumaisu
