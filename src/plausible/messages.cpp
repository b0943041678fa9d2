// SPDX-License-Identifier: BSD-3-Clause
#include "plausible/messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "plausible/covariance.h"
#include "plausible/rotation.h"

namespace kurumaisu {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;  // [ns]
constexpr std::array<int, 3> kRows{0, 1, 5};     // x, y, yaw among six
constexpr double kWallTime = 600;  // [s] clocks of computers that stand beside each other are so near

std::int64_t nanoseconds(const ros::Time& time) {
  return kSecond * static_cast<std::int64_t>(time.sec) + static_cast<std::int64_t>(time.nsec);
}

std::string seconds(const ros::Time& time) {
  std::ostringstream text;
  text.precision(15);
  text << time.toSec() << " s";
  return text.str();
}

}  // namespace

double secondsFrom(const ros::Time& from, const ros::Time& to) {
  return 1e-9 * static_cast<double>(nanoseconds(to) - nanoseconds(from));
}

ros::Time later(const ros::Time& time, double seconds) {
  constexpr std::int64_t kLast = kSecond * std::numeric_limits<std::uint32_t>::max();
  const double limit = 1e-9 * static_cast<double>(kLast);
  const double bounded = std::clamp(seconds, -limit, limit);
  const std::int64_t sum = nanoseconds(time) + std::llround(1e9 * bounded);
  const std::int64_t result = std::clamp<std::int64_t>(sum, 0, kLast);
  return {static_cast<std::uint32_t>(result / kSecond), static_cast<std::uint32_t>(result % kSecond)};
}

void requireStamp(const ros::Time& stamp) { require(plausible::kStamp, "stamp", stamp.toSec()); }

void requireStamp(const ros::Time& stamp, const ros::Time& now, double ahead) {
  requireStamp(stamp);
  if (now.isZero() || secondsFrom(now, stamp) <= ahead) return;
  std::ostringstream text;
  text << "stamp: must be at most " << ahead << " s ahead of this clock, " << seconds(now) << ": "
       << seconds(stamp)
       << (isWallTime(stamp) ? ", which is the wall's time, while this clock is /clock" : "");
  throw std::invalid_argument(text.str());
}

bool isWallTime(const ros::Time& stamp) {
  const ros::WallTime wall = ros::WallTime::now();
  return ros::Time::isSimTime() && std::abs(secondsFrom(stamp, {wall.sec, wall.nsec})) < kWallTime;
}

Pose2D planarOf(const geometry_msgs::Pose& pose) {
  require(plausible::kPosition, "position.x", pose.position.x);
  require(plausible::kPosition, "position.y", pose.position.y);
  const auto& q = pose.orientation;
  return {pose.position.x, pose.position.y, yawOf({q.x, q.y, q.z, q.w})};
}

Eigen::Matrix3d planarOf(const boost::array<double, 36>& values) {
  Eigen::Matrix3d out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out(i, j) = values[6 * kRows[i] + kRows[j]];
  }
  requireCovariance(out);
  return out;
}

void requireScan(const sensor_msgs::LaserScan& scan, const ros::Time& now) {
  requireStamp(scan.header.stamp, now);
  if (scan.header.stamp.isZero()) throw std::invalid_argument("stamp: must be above 0 s: it was not set");
  require(plausible::kAngle, "angle_min", scan.angle_min);
  require(plausible::kAngle, "angle_increment", scan.angle_increment);
  require(plausible::kDuration, "time_increment, times the number of readings",
          scan.time_increment * static_cast<double>(scan.ranges.size()));
  require(plausible::kRange, "range_min", scan.range_min);
  // inf says that the sensor has no limit, as a point cloud that was made a scan
  if (!(scan.range_max > 0)) {
    throw std::invalid_argument("range_max: must be above 0 m: " + std::to_string(scan.range_max));
  }
}

void requireMap(const nav_msgs::OccupancyGrid& map) {
  const auto& info = map.info;
  require(plausible::kResolution, "info.resolution", info.resolution);
  try {
    planarOf(info.origin);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(std::string("info.origin.") + error.what());
  }
  if (info.width > 0 && info.height > 0 &&
      map.data.size() == static_cast<std::size_t>(info.width) * static_cast<std::size_t>(info.height)) {
    return;
  }
  throw std::invalid_argument("a map of " + std::to_string(info.width) + " x " + std::to_string(info.height) +
                              " cells with " + std::to_string(map.data.size()) + " values");
}

}  // namespace kurumaisu
