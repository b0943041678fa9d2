// SPDX-License-Identifier: BSD-3-Clause
// What is wrong, once in a while: diagnostic_msgs/DiagnosticArray on diagnostics, with what has changed since the last.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>

#include <string>

#include "base/drive.h"
#include "base/guard_dac.h"
#include "base/node/settings.h"
#include "base/odometry_report.h"
#include "base/report.h"

namespace kurumaisu {

class DiagnosticsOutput {
 public:
  /// guard: or none. What is given must outlive this object.
  DiagnosticsOutput(const BaseSettings& settings, const Drive& drive, const GuardDac* guard);

  /// Publishes if it is time to, at a time of the control loop [s].
  void tick(double t);

 private:
  const BaseSettings& settings_;
  const Drive& drive_;
  Tally reported_;  ///< at the last one, as the others
  GyroCounts reported_gyro_;
  guard::Status reported_guard_;
  double last_ = 0;  ///< [s]
  diagnostic_updater::Updater updater_;
};

}  // namespace kurumaisu
