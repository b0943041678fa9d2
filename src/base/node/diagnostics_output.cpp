// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/diagnostics_output.h"

#include <cmath>

#include "steady.h"

namespace kurumaisu {
namespace {

using Status = diagnostic_updater::DiagnosticStatusWrapper;

void show(Status& status, const Report& report) {
  status.summary(report.error ? Status::ERROR : report.warning ? Status::WARN : Status::OK, report.summary);
  for (const auto& [name, value] : report.values) status.add(name, value);
}

}  // namespace

DiagnosticsOutput::DiagnosticsOutput(const BaseSettings& settings, const Drive& drive, const GuardDac* guard)
    : settings_(settings), drive_(drive) {
  updater_.setHardwareID("none");
  updater_.add("voltage law",
               [this](Status& status) { show(status, reportLaw(drive_.outlet(), settings_.law_name)); });
  updater_.add("commands", [this](Status& status) {
    show(status, reportCommands(drive_, reported_));
    reported_ = tally(drive_);
  });
  updater_.add("odometry", [this](Status& status) {
    const Reckoning& reckoning = drive_.reckoning();
    const KnownEffects& effects = settings_.effects;
    show(status, reportOdometry(reckoning, effects.unfollowed, effects.noise.has_value(), reported_gyro_));
    if (reckoning.gyro()) reported_gyro_ = reckoning.gyro()->counts();
  });
  if (guard == nullptr) return;
  updater_.add("guard", [this, guard](Status& status) {
    show(status, reportGuard(guard->status(), reported_guard_, steadyTime()));
    reported_guard_ = guard->status();
  });
}

void DiagnosticsOutput::tick(double t) {
  if (std::abs(t - last_) < settings_.diagnostic_period) return;
  last_ = t;
  updater_.force_update();  // update() would fall silent when the clock is set back
}

}  // namespace kurumaisu
