// SPDX-License-Identifier: BSD-3-Clause
// When a pose that is followed is no longer believed, and when it is again.
#pragma once

#include "slam/localization/settings.h"

namespace kurumaisu {

/// How well the map fits where the chair is believed to be, lately and usually.
struct Health {
  double fast = 0;  ///< share of readings explained, of the last second or so
  double slow = 0;  ///< of the last minute or so
  int scans = 0;

  void take(double fit, const RecoverySettings& settings);
  /// Worse than usual, or bad anyway; never from the first scans alone.
  bool doubtful(const RecoverySettings& settings) const;
};

/// A pose that is doubted may be a little off, or somewhere else.
class Doubt {
 public:
  enum class Step {
    kNone,    ///< go on
    kWiden,   ///< doubt begins: try the neighbourhood
    kSearch,  ///< it is not there: search all of the map
  };

  /// Keeps a reference to the settings.
  explicit Doubt(const RecoverySettings& settings) : settings_(&settings) {}

  /// What is to be done after a scan; travelled: since doubt began [m].
  Step judge(const Health& health, double travelled);

  bool standing() const { return scans_ > 0; }
  void clear() { scans_ = 0; }

 private:
  const RecoverySettings* settings_;
  double restored_ = 1;  ///< fit from which the pose is believed again
  int scans_ = 0;        ///< since it was first doubted; 0 = it is not
};

}  // namespace kurumaisu
