// SPDX-License-Identifier: BSD-3-Clause
// The beams of a planar scanner, and which of them leave within an angle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace kurumaisu {

constexpr double kTurn = 6.283185307179586476925;  // [rad]

/// Beams that leave one place at even angles: beam i at first + i * increment from the sensor's heading.
struct Beams {
  double first;         ///< bearing [rad]
  double increment;     ///< [rad], may be negative or 0
  std::size_t samples;  ///< beams
  double range_max;     ///< [m]
};

/// Finds the beams of a fan that leave within an angle, in any turn.
class BeamFinder {
 public:
  /// heading [rad]: of the sensor in the map.
  BeamFinder(const Beams& fan, double heading)
      : samples_(fan.samples),
        step_(std::abs(fan.increment)),
        inverse_(1.0 / step_),
        sign_(fan.increment > 0 ? 1.0 : -1.0),
        start_(std::remainder(heading + fan.first, kTurn)),
        last_(static_cast<double>(samples_) - 1),
        slack_(1e-12 * (1000 + std::abs(heading) + std::abs(fan.first))) {}

  /// Calls visit(i) for the beams whose direction in the map is within `half` [rad] of `middle`.
  ///
  /// middle: from -pi to pi. A few beams beside them may be visited too; with 0 as increment all are.
  template <typename Visit>
  void within(double middle, double half, const Visit& visit) const {
    const double width = half + slack_;
    if (step_ == 0 || !(2 * width < kTurn)) {
      for (std::size_t i = 0; i < samples_; ++i) visit(i);
      return;
    }
    // Angle from the first beam in the order of the beams, the smallest that some beam can have.
    double at = sign_ * (middle - start_);
    while (at + width < 0) at += kTurn;
    while (at + width >= kTurn) at -= kTurn;
    for (; at - width <= last_ * step_; at += kTurn) {
      const double from = std::max((at - width) * inverse_, 0.0);
      const double to = std::min((at + width) * inverse_, last_);
      auto i = static_cast<std::size_t>(from);
      if (static_cast<double>(i) < from) ++i;
      for (; static_cast<double>(i) <= to; ++i) visit(i);
    }
  }

 private:
  std::size_t samples_;
  double step_, inverse_, sign_;
  double start_;  ///< direction of the first beam in the map, from -pi to pi
  double last_;   ///< number of the last beam
  double slack_;  ///< [rad] far above rounding
};

}  // namespace kurumaisu
