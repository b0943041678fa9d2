// SPDX-License-Identifier: BSD-3-Clause
// The beams of a planar scanner, and which of them leave within an angle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace kurumaisu {

constexpr double kTurn = 6.283185307179586476925;  // [rad]

/// Beams that leave one place at even angles: beam i at first + i * increment from the sensor's heading.
struct Fan {
  double first;         ///< bearing [rad]
  double increment;     ///< [rad], may be negative or 0
  std::size_t samples;  ///< beams
  double range_max;     ///< [m]
};

/// Calls visit(i) for the beams whose bearing is within `half` [rad] of `middle`, modulo a whole turn.
///
/// A few beams beside them may be visited too. With 0 as increment all beams are.
template <typename Visit>
void visitBeams(const Fan& fan, double middle, double half, const Visit& visit) {
  const std::size_t n = fan.samples;
  const double slack = 1e-12 * (1000 + std::abs(middle) + std::abs(fan.first));  // [rad] far above rounding
  const double step = std::abs(fan.increment);
  const double width = half + slack;
  if (step == 0 || !(2 * width < kTurn)) {
    for (std::size_t i = 0; i < n; ++i) visit(i);
    return;
  }
  // Angle from the first beam in the direction in which they are numbered, at its smallest that can matter.
  double at = fan.increment > 0 ? middle - fan.first : fan.first - middle;
  at += kTurn * std::ceil(-(at + width) / kTurn);
  const double last = static_cast<double>(n - 1);
  for (; at - width <= last * step; at += kTurn) {
    const auto from = static_cast<std::size_t>(std::clamp(std::ceil((at - width) / step), 0.0, last + 1));
    const double to = std::min(std::floor((at + width) / step), last);
    for (std::size_t i = from; static_cast<double>(i) <= to; ++i) visit(i);
  }
}

}  // namespace kurumaisu
