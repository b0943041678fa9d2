// SPDX-License-Identifier: BSD-3-Clause
#include <mrpt/core/Clock.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/poses/CPosePDFGaussian.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "regular_file.h"
#include "slam/mapping/extent.h"
#include "slam/mapping/grid.h"
#include "slam/mapping/observation.h"
#include "slam/mapping/saved_map.h"
#include "slam/mapping/whole_file.h"

namespace kurumaisu {
namespace {

using mrpt::obs::CObservation2DRangeScan;

constexpr std::uintmax_t kMostBytes = std::uintmax_t{1} << 30U;  // of a simplemap

// As CPose3DPDF: MRPT 2.5.8 does not take a CPosePDF here, though it says so.
mrpt::poses::CPose3DPDF::Ptr gaussianOf(const KeyScan& key) {
  const mrpt::poses::CPose2D mean(key.map_from_base.x, key.map_from_base.y, key.map_from_base.theta);
  mrpt::math::CMatrixDouble33 covariance;
  for (int i = 0; i < 9; ++i) covariance(i / 3, i % 3) = key.covariance[i];
  return mrpt::poses::CPose3DPDFGaussian::Create(mrpt::poses::CPosePDFGaussian(mean, covariance));
}

/// x, y, yaw of a pose in space.
void setPose(KeyScan& key, const mrpt::poses::CPose3DPDF& pose) {
  const auto [covariance, mean] = pose.getCovarianceAndMean();
  key.map_from_base = {mean.x(), mean.y(), mean.yaw()};
  for (int i = 0; i < 9; ++i) key.covariance[i] = covariance(i / 3 == 2 ? 3 : i / 3, i % 3 == 2 ? 3 : i % 3);
}

std::vector<KeyScan> keysOf(const mrpt::maps::CSimpleMap& map) {
  std::vector<KeyScan> keys;
  for (const auto& [pose, frame] : map) {
    if (!pose || !frame) continue;
    for (const auto& observation : *frame) {
      const auto scan = std::dynamic_pointer_cast<CObservation2DRangeScan>(observation);
      if (!scan) continue;
      KeyScan key{};
      setPose(key, *pose);
      key.scan = {mrpt::Clock::toDouble(scan->timestamp), fanOf(*scan), rangesOf(*scan)};
      validate(key.scan);
      keys.push_back(std::move(key));
    }
  }
  return keys;
}

/// Writes a map, and reads it again: MRPT does not hear of a disk that is full when it closes the file.
bool wholeSimplemap(const mrpt::maps::CSimpleMap& map, const std::string& name) {
  mrpt::maps::CSimpleMap again;
  return map.saveToFile(name) && again.loadFromFile(name) && again.size() == map.size();
}

}  // namespace

void writeSimplemap(const std::string& path, const std::vector<KeyScan>& keys) {
  if (keys.empty()) throw std::runtime_error(path + ": nothing has been mapped yet");
  mrpt::maps::CSimpleMap map;
  for (const KeyScan& key : keys) {
    const auto frame = mrpt::obs::CSensoryFrame::Create();
    frame->insert(keptObservation(key.scan));
    map.insert(gaussianOf(key), frame);
  }
  replaceWhole({{path, [&map](const std::string& name) { return wholeSimplemap(map, name); }}});
}

std::vector<KeyScan> readSimplemap(const std::string& path) {
  const std::string why = whyNotRead(path, kMostBytes);
  if (!why.empty()) throw std::runtime_error(path + ": " + why);
  std::vector<KeyScan> keys;
  try {
    mrpt::maps::CSimpleMap map;
    if (!map.loadFromFile(path)) throw std::runtime_error("is not a simplemap");
    keys = keysOf(map);
  } catch (const std::exception& error) {
    const std::string what = error.what();  // of MRPT's, the first line says it
    throw std::runtime_error(path + ": is not a simplemap to continue: " + what.substr(0, what.find('\n')));
  }
  if (keys.empty()) throw std::runtime_error(path + ": has no laser scan");
  return keys;
}

SavedMap savedMapOf(std::vector<KeyScan> keys, const MapperSettings& settings) {
  Extent extent;
  for (const KeyScan& key : keys) extent.add(key.map_from_base, key.scan, settings.range);
  extent.check(settings);
  const auto resolution = static_cast<float>(settings.resolution);
  mrpt::maps::COccupancyGridMap2D grid(static_cast<float>(extent.x0), static_cast<float>(extent.x1),
                                       static_cast<float>(extent.y0), static_cast<float>(extent.y1),
                                       resolution);
  setInsertion(grid.insertionOptions, settings);
  for (const KeyScan& key : keys) {
    const Pose2D& pose = key.map_from_base;
    const mrpt::poses::CPose3D at(pose.x, pose.y, 0, pose.theta, 0, 0);
    grid.insertObservation(*insertionObservation(key.scan, std::fmin(settings.range, key.scan.fan.range_max)),
                           at);
  }
  return {occupancyOf(grid), std::move(keys)};
}

}  // namespace kurumaisu
