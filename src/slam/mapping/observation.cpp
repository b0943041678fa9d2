// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/observation.h"

#include <mrpt/core/Clock.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

using mrpt::obs::CObservation2DRangeScan;

constexpr double kLevel = 0.1;  // [rad] a laser tilted by more does not measure in the plane

/// intervals: how many steps of the fan's angle MRPT divides the aperture into.
CObservation2DRangeScan::Ptr observation(const Scan& scan, std::size_t intervals) {
  const Fan& fan = scan.fan;
  auto out = CObservation2DRangeScan::Create();
  const double width = fan.angle_increment * static_cast<double>(intervals);
  out->aperture = static_cast<float>(std::abs(width));
  out->rightToLeft = width > 0;
  const Pose2D centre = compose(fan.base_from_laser, {0, 0, fan.angle_min + width / 2});
  out->sensorPose = mrpt::poses::CPose3D(centre.x, centre.y, 0, wrapAngle(centre.theta), 0, 0);
  out->maxRange = static_cast<float>(fan.range_max);
  out->resizeScanAndAssign(scan.ranges.size(), 0.0F, false);
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (!std::isfinite(scan.ranges[i])) continue;
    out->setScanRange(i, scan.ranges[i]);
    out->setScanRangeValidity(i, true);
  }
  return out;
}

}  // namespace

CObservation2DRangeScan::Ptr likelihoodObservation(const Scan& scan) {
  return observation(scan, scan.ranges.size() - 1);
}

CObservation2DRangeScan::Ptr insertionObservation(const Scan& scan, double free_range) {
  // MRPT 2.5.8 divides the aperture of n beams by n when it inserts, but by n - 1 when it makes points of it:
  // with one observation for both, the map would be turned against the likelihood, by a beam at the last one.
  auto out = observation(scan, scan.ranges.size());
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (!std::isinf(scan.ranges[i])) continue;
    // A valid reading beyond the grid's limit: free up to the limit, and no wall at its end.
    out->setScanRange(i, static_cast<float>(2 * free_range));
    out->setScanRangeValidity(i, true);
  }
  return out;
}

CObservation2DRangeScan::Ptr keptObservation(const Scan& scan) {
  auto out = likelihoodObservation(scan);
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (std::isinf(scan.ranges[i])) out->setScanRange(i, out->maxRange);
  }
  out->sensorLabel = "laser";
  out->timestamp = mrpt::Clock::fromDouble(scan.stamp);
  return out;
}

Fan fanOf(const CObservation2DRangeScan& scan) {
  if (scan.getScanSize() < 2) throw std::runtime_error("has a scan of fewer than 2 beams");
  const auto& mount = scan.sensorPose;
  const bool upside_down = std::abs(wrapAngle(mount.roll() - M_PI)) < kLevel;
  if (std::abs(mount.pitch()) > kLevel || (!upside_down && std::abs(mount.roll()) > kLevel)) {
    throw std::runtime_error("the laser is tilted");
  }
  const double turn = scan.rightToLeft != upside_down ? 1 : -1;
  const double aperture = scan.aperture;
  return {-turn * aperture / 2,
          turn * aperture / static_cast<double>(scan.getScanSize() - 1),
          0,
          scan.maxRange,
          {mount.x(), mount.y(), mount.yaw()}};
}

std::vector<float> rangesOf(const CObservation2DRangeScan& scan) {
  std::vector<float> ranges(scan.getScanSize());
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const float range = scan.getScanRange(i);
    const bool none = range >= scan.maxRange;
    if (none) {
      ranges[i] = std::numeric_limits<float>::infinity();
    } else {
      ranges[i] = scan.getScanRangeValidity(i) ? range : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return ranges;
}

void setInsertion(mrpt::maps::COccupancyGridMap2D::TInsertionOptions& options,
                  const MapperSettings& settings) {
  options.maxDistanceInsertion = static_cast<float>(settings.range);
  options.maxOccupancyUpdateCertainty = static_cast<float>(settings.certainty);
  options.considerInvalidRangesAsFreeSpace = false;  // insertionObservation() says what is free
}

}  // namespace kurumaisu
