// SPDX-License-Identifier: BSD-3-Clause
#include "laser/fan.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace kurumaisu::laser {
namespace {

constexpr double kTurnHalf = M_PI + 0.01;  // [rad] 3.1416 is meant as pi, -180 is not
constexpr double kRounding = 1e-3;         // [steps] by which a bearing may miss a step: 1.5707963, a float32
constexpr int kClusterMax = 99;            // two digits
constexpr int kSkipMax = 9;                // one digit
constexpr int kCodesEnd = 20;              // distances below are codes
constexpr int kFarCode = 0;                // of the URG-04LX: nothing within 22 m
constexpr int kBeyondCode = 6;             // of the URG-04LX: beyond its reach
constexpr double kMetre = 1000;            // [mm]

void require(bool holds, const std::string& parameter, double value, const std::string& rule) {
  if (!holds) throw std::invalid_argument(parameter + " " + std::to_string(value) + " " + rule);
}

void check(const Window& window) {
  for (const auto& [name, angle] :
       {std::pair("angle_min", window.angle_min), {"angle_max", window.angle_max}}) {
    require(std::abs(angle) <= kTurnHalf, name, angle, "must be from -pi to pi [rad]");
  }
  require(window.angle_min <= window.angle_max, "angle_min", window.angle_min,
          "must not be above angle_max " + std::to_string(window.angle_max));
  require(window.cluster >= 1 && window.cluster <= kClusterMax, "cluster", window.cluster,
          "must be from 1 to " + std::to_string(kClusterMax));
  require(window.skip >= 0 && window.skip <= kSkipMax, "skip", window.skip,
          "must be from 0 to " + std::to_string(kSkipMax));
}

std::string fromTo(double from, double to) { return std::to_string(from) + " to " + std::to_string(to); }

scip::Request ask(const scip::Parameters& sensor, const Window& window) {
  check(window);
  const std::string reach = fromTo(sensor.bearing(sensor.first), sensor.bearing(sensor.last));
  require(window.angle_min <= sensor.bearing(sensor.last), "angle_min", window.angle_min,
          "lies outside what the sensor sees, " + reach + " rad");
  require(window.angle_max >= sensor.bearing(sensor.first), "angle_max", window.angle_max,
          "lies outside what the sensor sees, " + reach + " rad");
  const double increment = sensor.increment();
  const int from = sensor.front + static_cast<int>(std::ceil(window.angle_min / increment - kRounding));
  const int to = sensor.front + static_cast<int>(std::floor(window.angle_max / increment + kRounding));
  scip::Request request;
  request.first = std::max(from, sensor.first);
  const int steps = std::min(to, sensor.last) - request.first + 1;
  require(steps > 0, "angle_max", window.angle_max,
          "leaves no step between it and angle_min " + std::to_string(window.angle_min));
  require(steps >= window.cluster, "cluster", window.cluster,
          "is more than the " + std::to_string(steps) + " steps from angle_min to angle_max");
  request.last = request.first + steps / window.cluster * window.cluster - 1;
  request.cluster = window.cluster;
  request.interval = window.skip;
  request.form = window.intensity ? scip::Form::kIntensity : scip::Form::kDistance;
  return request;
}

}  // namespace

Fan::Fan(const scip::Parameters& sensor, const Window& window)
    : request_(ask(sensor, window)), distance_min_(sensor.distance_min), distance_max_(sensor.distance_max) {
  const double middle = 0.5 * (window.cluster - 1);  // [steps] of a cluster, from its first step
  first_beam_ = (request_.first + middle) * sensor.stepTime();
  least_delay_ = request_.last * sensor.stepTime();
  empty_.angle_increment = window.cluster * sensor.increment();
  empty_.angle_min = sensor.bearing(request_.first) + middle * sensor.increment();
  empty_.angle_max = sensor.bearing(request_.last) - middle * sensor.increment();
  empty_.time_increment = window.cluster * sensor.stepTime();
  // sensor_msgs/LaserScan: "time between scans"
  empty_.scan_time = (window.skip + 1) * sensor.scanTime();
  empty_.range_min = sensor.distance_min / kMetre;
  empty_.range_max = sensor.distance_max / kMetre;
}

float Fan::range(int distance) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  if (distance == kFarCode || distance == kBeyondCode || distance > distance_max_) return kInfinity;
  if (distance < std::max(kCodesEnd, distance_min_)) return std::numeric_limits<float>::quiet_NaN();
  return static_cast<float>(distance / kMetre);
}

Scan Fan::convert(const scip::Rotation& rotation, double time) const {
  assert(rotation.distances.size() == static_cast<std::size_t>(scip::beams(request_)));
  Scan scan = empty_;
  scan.stamp = time + first_beam_;
  scan.clock = rotation.clock;
  scan.ranges.reserve(rotation.distances.size());
  for (const int distance : rotation.distances) scan.ranges.push_back(range(distance));
  scan.intensities.assign(rotation.intensities.begin(), rotation.intensities.end());
  return scan;
}

}  // namespace kurumaisu::laser
