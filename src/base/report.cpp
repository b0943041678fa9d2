// SPDX-License-Identifier: BSD-3-Clause
#include "base/report.h"

#include <sstream>

namespace kurumaisu {
namespace {

std::string textOf(const Band& band) {
  std::ostringstream out;
  out << "(" << band.low << ", " << band.high << ")";
  return out.str();
}

const std::string& nameOf(const Drive& drive) {
  const Arbiter& arbiter = drive.arbiter();
  return arbiter.settings().inputs[*arbiter.last().input].name;
}

}  // namespace

std::string shown(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

Tally tally(const Drive& drive) {
  return {drive.counts(), drive.arbiter().counts(), drive.speedCap().counts(),
          drive.outlet().counts().clamped};
}

std::string ambiguity(const Outlet& outlet) {
  std::string text;
  const auto say = [&text](const std::string& name, const std::optional<Band>& band) {
    if (!band) return;
    text += (text.empty() ? "" : "; ") + name + " in " + textOf(*band) + " V stands for two rates";
  };
  say("V_f", outlet.translationBand());
  say("V_s", outlet.steeringBand());
  return text;
}

Report reportLaw(const Outlet& outlet, const std::string& law_name) {
  const std::string warning = ambiguity(outlet);
  Report report{!warning.empty(),
                law_name + ": " + (warning.empty() ? "every voltage stands for one rate" : warning),
                {{"voltage law", law_name}}};
  const auto add = [&report](const char* name, const std::optional<Band>& band) {
    report.values.emplace_back(name, band ? textOf(*band) : "none");
  };
  add("ambiguous V_f [V]", outlet.translationBand());
  add("ambiguous V_s [V]", outlet.steeringBand());
  report.values.emplace_back("samples", std::to_string(outlet.counts().samples));
  report.values.emplace_back("ambiguous samples", std::to_string(outlet.counts().ambiguous));
  report.values.emplace_back("samples cut by the band", std::to_string(outlet.counts().clamped));
  return report;
}

std::vector<std::string> deadMenUnheard(const Arbiter& arbiter) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < arbiter.settings().locks.size(); ++i) {
    const LockSettings& lock = arbiter.settings().locks[i];
    const bool waits = lock.timeout > 0 && lock.from_start;
    if (!lock.blocks_on && !waits && !arbiter.hasHeard(i)) names.push_back(lock.name);
  }
  return names;
}

Report reportCommands(const Drive& drive, const Tally& before) {
  const Tally now = tally(drive);
  std::string warning;
  const auto warn = [&warning](bool happened, const char* words) {
    if (happened) warning += (warning.empty() ? "" : "; ") + std::string(words);
  };
  warn(now.arbiter.refused > before.arbiter.refused, "command refused");
  warn(now.drive.clamped > before.drive.clamped, "command beyond a limit");
  warn(now.drive.ignored > before.drive.ignored, "command with components that are not obeyed");
  warn(now.arbiter.timeouts > before.arbiter.timeouts, "command timed out");
  warn(now.cap.refused > before.cap.refused, "speed cap refused");
  warn(now.cut > before.cut, "voltage cut by its band");
  warn(now.drive.late_ticks > before.drive.late_ticks, "late");
  warn(now.drive.time_resets > before.drive.time_resets, "time ran backwards");
  const Reason reason = drive.arbiter().last().reason;
  const bool held = drive.isCutOff() || (reason != Reason::kDriving && reason != Reason::kIdle);
  const std::string active = activeInput(drive);
  return {held || !warning.empty(),
          stateOf(drive) + (warning.empty() ? "" : "; " + warning),
          {{"state", stateOf(drive)},
           {"active", active.empty() ? "none" : active},
           {"speed cap [m/s]", shown(drive.cap())},
           {"dead-men never heard", joined(deadMenUnheard(drive.arbiter()))},
           {"commands", std::to_string(now.arbiter.commands)},
           {"refused commands", std::to_string(now.arbiter.refused)},
           {"clamped commands", std::to_string(now.drive.clamped)},
           {"commands with ignored components", std::to_string(now.drive.ignored)},
           {"timeouts", std::to_string(now.arbiter.timeouts)},
           {"locked", std::to_string(now.arbiter.locked)},
           {"conflicts", std::to_string(now.arbiter.conflicts)},
           {"not released", std::to_string(now.arbiter.unreleased)},
           {"refused caps", std::to_string(now.cap.refused)},
           {"late ticks", std::to_string(now.drive.late_ticks)},
           {"time resets", std::to_string(now.drive.time_resets)}},
          drive.eStop().stopped()};
}

std::string lockWarning(const Arbiter& arbiter) {
  const std::vector<std::string> unheard = deadMenUnheard(arbiter);
  if (unheard.empty()) return "";
  return "BASE_NO_DEAD_MAN: nobody has spoken on " + joined(unheard) +
         ": until somebody does, the chair drives without";
}

std::string stateOf(const Drive& drive) {
  if (drive.eStop().latched()) return "emergency stop";
  if (drive.eStop().stopped()) return "waiting for the emergency stop's first message";
  if (drive.isCutOff()) return "cut off: the ROS master is gone";
  const Choice& choice = drive.arbiter().last();
  switch (choice.reason) {
    case Reason::kDriving:
      return "driving: " + nameOf(drive);
    case Reason::kLocked:
      return "locked: " + drive.arbiter().settings().locks[*choice.lock].name;
    case Reason::kSeveral:
      return "several publishers: " + nameOf(drive);
    case Reason::kUnreleased:
      return "not released: " + nameOf(drive);
    default:
      return "idle";
  }
}

std::string activeInput(const Drive& drive) {
  const bool driving =
      !drive.eStop().stopped() && !drive.isCutOff() && drive.arbiter().last().reason == Reason::kDriving;
  return driving ? nameOf(drive) : "";
}

std::string warningOf(const Drive& drive, const Tally& before, const std::string& state) {
  const Arbiter& arbiter = drive.arbiter();
  if (arbiter.counts().timeouts > before.arbiter.timeouts)
    return "BASE_COMMAND_TIMEOUT: no more commands: brakes";
  if (stateOf(drive) == state) return "";
  if (drive.eStop().stopped()) return "BASE_EMERGENCY_STOP: neutral at once, until ~reset is called";
  if (drive.isCutOff()) return "BASE_MASTER_LOST: the ROS master does not answer: brakes";
  const Choice& choice = arbiter.last();
  switch (choice.reason) {
    case Reason::kLocked:
      return "BASE_LOCKED: " + arbiter.settings().locks[*choice.lock].name + " stops " + nameOf(drive) +
             ": brakes";
    case Reason::kSeveral:
      return "BASE_SEVERAL_PUBLISHERS: " + nameOf(drive) + ": " + joined(arbiter.publishers(*choice.input)) +
             ": brakes until only one is left";
    case Reason::kUnreleased:
      return "BASE_NOT_RELEASED: " + nameOf(drive) + " must send zero, or be released, before it is obeyed";
    default:
      return "";
  }
}

}  // namespace kurumaisu
