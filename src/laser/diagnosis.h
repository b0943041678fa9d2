// SPDX-License-Identifier: BSD-3-Clause
// What diagnostics say of the laser, in words; keys are REP 138's where it has one.
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "laser/driver.h"

namespace kurumaisu::laser {

enum class Level { kOk, kWarn, kError, kStale };

/// One line of diagnostics, and values by name.
struct Diagnosis {
  Level level;
  std::string summary;
  std::vector<std::pair<std::string, std::string>> values;
};

/// How often scans come, over a window of time.
class Rhythm {
 public:
  /// window: [s]
  explicit Rhythm(double window) : window_(window) {}

  /// A scan came at the host's time [s]. One that runs backwards starts afresh.
  void add(double time);

  /// [1/s] between the first and the last scan of the window that ends now; none with fewer than two.
  std::optional<double> rate(double now) const;

 private:
  double window_;
  std::deque<double> times_;
};

/// What a sensor says of itself: SERI of VV, STAT of II; empty until it has.
std::string serialNumber(const Device& device);
std::string health(const Device& device);

/// Is what a sensor says of its own state (II: STAT) one of the ways to say that it is well?
bool isWell(const std::string& stat);

/// The sensor and the way to it. before: the counts at the last report; what has happened since then is a
/// warning.
Diagnosis diagnoseDevice(const Status& status, const Counts& before, const DriverSettings& settings,
                         double time_offset);

/// The scans' rate and delay. now: [s] host's time; tolerance: of the rate; stale: [s] from which on silence is.
Diagnosis diagnoseScans(const Status& status, std::optional<double> rate, double now, double tolerance,
                        double stale);

}  // namespace kurumaisu::laser
