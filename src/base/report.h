// SPDX-License-Identifier: BSD-3-Clause
// What diagnostics say of the base, in words.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/drive.h"

namespace kurumaisu {

/// One line of diagnostics: a warning or all well, and values by name.
struct Report {
  bool warning;
  std::string summary;
  std::vector<std::pair<std::string, std::string>> values;
};

/// Says between which voltages a law has two rates; empty for a law that is unambiguous.
std::string ambiguity(const Drive& drive);

Report reportLaw(const Drive& drive, const std::string& law_name);

/// before: the counts at the last report; what has happened since then is a warning.
Report reportCommands(const Drive& drive, const DriveCounts& before);

}  // namespace kurumaisu
