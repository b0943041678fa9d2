// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/camera/optics.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace kurumaisu {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Angles to the left [rad] of the half-planes, from right to left.
std::vector<double> columnsOf(const Optics& o, double fx, double low, double high) {
  if (o.tilt == 0) {
    std::vector<double> angles(static_cast<std::size_t>(o.width));
    for (int k = 0; k < o.width; ++k)
      angles[static_cast<std::size_t>(k)] = std::atan((k + 0.5 - o.width / 2.0) / fx);
    return angles;
  }
  const double width = high - low;
  const int n = std::clamp(static_cast<int>(Sights::kFiner * width * fx), 2, 2 * Sights::kFiner * o.width);
  std::vector<double> angles(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) angles[static_cast<std::size_t>(k)] = low + width * k / (n - 1);
  return angles;
}

}  // namespace

void validate(const Optics& o) {
  constexpr std::int64_t kMost = 10'000'000;
  if (o.width < 1 || o.height < 1 || std::int64_t{o.width} * o.height > kMost)
    throw std::invalid_argument("width and height must make 1 to 10 million pixels");
  if (!(o.fov_h > 0 && o.fov_h < kPi && o.fov_v > 0 && o.fov_v < kPi))
    throw std::invalid_argument("fields of view must be above 0 and below pi");
  if (!(o.near >= 0 && o.far > o.near && std::isfinite(o.far)))
    throw std::invalid_argument("near and far must be 0 <= near < far, finite");
  if (!(std::fabs(o.tilt) <= kPi / 2)) throw std::invalid_argument("tilt must be within +-pi / 2");
}

double turn(double x, double y) {
  constexpr double kTiny = 1e-300;  // [m] keeps the eye itself from dividing by zero
  const double part = y / (std::fabs(x) + std::fabs(y) + kTiny);
  if (x >= 0) return part;
  return y >= 0 ? 2 - part : -2 - part;
}

Sights makeSights(const Optics& o) {
  validate(o);
  const double fx = o.width / (2 * std::tan(o.fov_h / 2));
  const double fy = o.height / (2 * std::tan(o.fov_v / 2));
  const double c = std::cos(o.tilt);
  const double s = std::sin(o.tilt);
  Sights sights{{}, {}, 0.0};
  std::vector<double> angles;
  double longest = 0.0;
  for (int v = 0; v < o.height; ++v) {
    const double down = (v + 0.5 - o.height / 2.0) / fy;
    for (int u = 0; u < o.width; ++u) {
      const double left = (o.width / 2.0 - u - 0.5) / fx;
      const double ahead = c - down * s;
      constexpr double kSteep = 1e-6;  // straight up and down have no azimuth
      const double level = std::max(std::hypot(ahead, left), kSteep);
      longest = std::max(longest, level);
      angles.push_back(std::atan2(left, ahead));
      sights.pixels.push_back(
          {o.width - 1 - u, static_cast<float>((-s - down * c) / level), static_cast<float>(1 / level)});
    }
  }
  const auto [low, high] = std::minmax_element(angles.begin(), angles.end());
  const std::vector<double> columns = columnsOf(o, fx, *low, *high);
  for (const double angle : columns) {
    const double dx = std::cos(angle);
    const double dy = std::sin(angle);
    sights.columns.push_back({turn(dx, dy), dx, dy});
  }
  const double width = std::max(*high - *low, 1e-9);
  const auto last = static_cast<double>(columns.size() - 1);
  for (std::size_t i = 0; o.tilt != 0 && i < angles.size(); ++i)
    sights.pixels[i].column = static_cast<std::int32_t>(std::lround((angles[i] - *low) / width * last));
  sights.reach = o.far * longest * (1 + 1e-6);
  return sights;
}

}  // namespace kurumaisu
