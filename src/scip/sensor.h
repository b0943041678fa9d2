// SPDX-License-Identifier: BSD-3-Clause
// What a sensor says of itself: PP, VV, II.
#pragma once

#include <map>
#include <string>

#include "scip/message.h"

namespace kurumaisu::scip {

/// PP: what it measures. Steps count counter-clockwise from the rear, so the front is half a turn on.
struct Parameters {
  std::string model;       ///< MODL
  int distance_min = 0;    ///< DMIN [mm]
  int distance_max = 0;    ///< DMAX [mm]
  int steps_per_turn = 0;  ///< ARES
  int first = 0;           ///< AMIN, first step that is measured
  int last = 0;            ///< AMAX, last step that is
  int front = 0;           ///< AFRT, step of bearing 0
  double rpm = 0;          ///< SCAN, of the mirror [1/min]

  double increment() const;        ///< [rad] from step to step
  double bearing(int step) const;  ///< [rad] counter-clockwise from the front
  double scanTime() const;         ///< [s] of one turn
  double stepTime() const;         ///< [s] from step to step
};

/// The values of `KEY:value` lines.
std::map<std::string, std::string> keyed(const Message& message);

/// PP's values. Throws BadFrame naming the key that is missing, is no number or contradicts another.
Parameters parameters(const Message& message);

}  // namespace kurumaisu::scip
