// SPDX-License-Identifier: BSD-3-Clause
#include "model/laser_error.h"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace kurumaisu {

double LaserError::deviation(double r) const {
  return std::fmax(0.0, sigma[0] + r * (sigma[1] + r * sigma[2]));
}

double LaserError::reading(double r, double standard_normal) const {
  if (!std::isfinite(r)) return r;
  double value = mean(r) + deviation(r) * standard_normal;
  if (resolution > 0) value = resolution * std::nearbyint(value / resolution);
  if (value > range_max) return std::numeric_limits<double>::infinity();
  if (value < range_min) return std::numeric_limits<double>::quiet_NaN();
  return value;
}

void validate(const LaserError& error) {
  if (!(error.scale > 0)) throw std::invalid_argument("scale must be positive");
  if (!std::isfinite(error.datum_offset)) throw std::invalid_argument("datum_offset must be finite");
  if (!(error.resolution >= 0)) throw std::invalid_argument("resolution must not be negative");
  if (!(error.range_min >= 0)) throw std::invalid_argument("range_min must not be negative");
  if (!(error.range_max > error.range_min)) throw std::invalid_argument("range_max must exceed range_min");
  for (const double coefficient : error.sigma) {
    if (!std::isfinite(coefficient)) throw std::invalid_argument("sigma must be finite");
  }
}

}  // namespace kurumaisu
