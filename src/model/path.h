// SPDX-License-Identifier: BSD-3-Clause
// Equation (3) along a whole drive: what replays of recordings spend their time on.
#pragma once

#include <cstddef>

#include "model/unicycle.h"

namespace kurumaisu {

/// Rates of n steps, each held for its time.
struct Steps {
  const double* v;   ///< forward [m/s]
  const double* w;   ///< yaw rate [rad/s]
  const double* dt;  ///< [s]
  std::size_t n;
};

/// Writes the poses x, y [m], theta [rad] before each step and after the last one, 3 (n + 1) numbers.
///
/// They are those of advance() but for the last bits of the sines and cosines, which are taken of eight steps at once.
void integrate(const Pose2D& start, const Steps& steps, double* poses);

}  // namespace kurumaisu
