// SPDX-License-Identifier: BSD-3-Clause
// What diagnostics and the log say of the base, in words.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/drive.h"

namespace kurumaisu {

/// One line of diagnostics: an error, a warning or all well, and values by name.
struct Report {
  bool warning;
  std::string summary;
  std::vector<std::pair<std::string, std::string>> values;
  bool error = false;
};

/// All counts of a drive; what has changed since the last report is a warning.
struct Tally {
  DriveCounts drive;
  ArbiterCounts arbiter;
  SpeedCap::Counts cap;
  std::uint64_t cut = 0;  ///< samples that the band of the voltages cut
};

std::string shown(double value);

/// Words with a comma between each two.
std::string joined(const std::vector<std::string>& words);

Tally tally(const Drive& drive);

/// Says between which voltages a law has two rates; empty for a law that is unambiguous.
std::string ambiguity(const Outlet& outlet);

Report reportLaw(const Outlet& outlet, const std::string& law_name);

/// before: the counts at the last report.
Report reportCommands(const Drive& drive, const Tally& before);

/// Locks that are dead-men (let go, they engage) but do not engage yet: nobody has spoken on them.
std::vector<std::string> deadMenUnheard(const Arbiter& arbiter);

/// What there is to know of the locks at the start: that nobody holds a dead-man; "": nothing.
std::string lockWarning(const Arbiter& arbiter);

/// What the chair does, in a word that stays the same: "driving: joystick", "idle", "locked: dead_man", ...
std::string stateOf(const Drive& drive);

/// What changed from one state to the next and is worth a warning, beginning with a stable code; or "".
std::string warningOf(const Drive& drive, const Tally& before, const std::string& state);

/// Name of the input that drives, or "".
std::string activeInput(const Drive& drive);

}  // namespace kurumaisu
