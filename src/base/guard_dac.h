// SPDX-License-Identifier: BSD-3-Clause
// The D/A converter behind a guard: another process owns it, and may refuse. No ROS.
#pragma once

#include "base/dac.h"
#include "base/report.h"
#include "guard/client.h"
#include "model/voltage_law.h"

namespace kurumaisu {

/// Asks the guard for every sample, also while it refuses: so it is armed by nobody but whoever drives, by letting go.
class GuardDac : public Dac {
 public:
  /// silence: the guard's [s].
  GuardDac(const guard::ClientSettings& settings, double silence, const VoltageLaw& law)
      : client_(settings), silence_(silence), law_(law) {}

  /// What the guard says that the converter holds, and the rates that it stands for; neutral while there is no guard.
  Output put(const Output& asked) override;

  double patience() const override { return silence_; }

  const guard::Status& status() const { return client_.status(); }

 private:
  guard::Client client_;
  double silence_;
  VoltageLaw law_;
  Output held_{};
};

/// before: the status at the last report; now [s, monotonic].
Report reportGuard(const guard::Status& status, const guard::Status& before, double now);

}  // namespace kurumaisu
