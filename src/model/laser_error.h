// SPDX-License-Identifier: BSD-3-Clause
// Equation (4): what a URG-04LX reads at a true range.
#pragma once

#include <array>

namespace kurumaisu {

/// Measurement model of a range r [m], applied in this order: bias, noise, quantisation, gate.
///
/// Equation (4)'s mu is the mean reading, not the mean error. Its constant 0.058826 m is the distance from the
/// front of the housing, where the paper taped from, to the sensor's centre: datum_offset, which may be 0.
struct LaserError {
  double scale;                 ///< slope of mu [-]
  double datum_offset;          ///< constant of mu [m]
  std::array<double, 3> sigma;  ///< coefficients of r^0 [m], r^1 [-], r^2 [1/m] of the standard deviation
  double resolution;            ///< readings are multiples of this [m]; 0 = not quantised
  double range_min;             ///< readings below are NaN [m]
  double range_max;             ///< readings above are +inf [m]

  /// Mean reading mu [m] before quantisation and gate.
  double mean(double r) const { return scale * r + datum_offset; }

  /// Standard deviation [m], never negative.
  double deviation(double r) const;

  /// True range [m] of which a reading is the mean: what a map should be made of.
  double range(double reading) const { return (reading - datum_offset) / scale; }

  /// Reading [m] of true range r, for one draw of the standard normal. An infinite r (no return) stays +inf.
  double reading(double r, double standard_normal) const;
};

/// Throws std::invalid_argument naming the first value that makes no sense.
void validate(const LaserError& error);

}  // namespace kurumaisu
