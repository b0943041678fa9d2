// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/rawlog.h"

#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/io/CMemoryStream.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CActionRobotMovement3D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>

#include "regular_file.h"
#include "slam/basics/pose.h"
#include "slam/mapping/observation.h"

namespace kurumaisu {
namespace {

using mrpt::obs::CObservation2DRangeScan;

constexpr std::uintmax_t kMost = 8'000'000'000;  // bytes, packed or not; a day of scans has a quarter of it
constexpr std::uintmax_t kLeast = 64'000'000;    // bytes that any file may have unpacked,
constexpr std::uintmax_t kTimes = 200;           // and times its size: scans are packed 2 to 20 times

/// The decompressed bytes. In memory, because only there the end of the last object can be told from a file
/// that was cut off.
std::vector<std::uint8_t> contents(const std::string& path) {
  const std::string why = whyNotRead(path, kMost);
  if (!why.empty()) throw std::runtime_error(why);
  mrpt::io::CFileGZInputStream file;
  if (!file.open(path)) throw std::runtime_error("cannot be read");
  const std::uintmax_t most = std::min(kMost, kLeast + kTimes * std::filesystem::file_size(path));
  std::vector<std::uint8_t> bytes;
  constexpr std::size_t kChunk = 1U << 20U;
  for (std::size_t got = kChunk; got > 0;) {
    bytes.resize(bytes.size() + kChunk);
    got = file.Read(bytes.data() + bytes.size() - kChunk, kChunk);
    if (got > kChunk) throw std::runtime_error("is damaged: it cannot be decompressed");
    bytes.resize(bytes.size() - kChunk + got);
    if (bytes.size() > most)
      throw std::runtime_error("has more than " + std::to_string(most) + " bytes unpacked");
  }
  if (bytes.empty()) throw std::runtime_error("is empty");
  return bytes;
}

Pose2D poseOf(const mrpt::poses::CPose2D& pose) { return {pose.x(), pose.y(), pose.phi()}; }

class Reader {
 public:
  void take(const mrpt::serialization::CSerializable::Ptr& object) {
    using namespace mrpt::obs;
    if (const auto actions = std::dynamic_pointer_cast<CActionCollection>(object)) {
      move(*actions);
    } else if (const auto frame = std::dynamic_pointer_cast<CSensoryFrame>(object)) {
      for (const auto& observation : *frame) observe(*observation);
    } else if (const auto observation = std::dynamic_pointer_cast<CObservation>(object)) {
      observe(*observation);
    }
  }

  LaserLog finish() {
    if (log_.times.empty()) throw std::runtime_error("has no laser scan");
    if (!has_odometry_) throw std::runtime_error("has no odometry");
    return std::move(log_);
  }

 private:
  void move(mrpt::obs::CActionCollection& actions) {
    if (const auto flat = actions.getBestMovementEstimation()) {
      odom_ = compose(odom_, poseOf(flat->rawOdometryIncrementReading));
    } else if (const auto solid = actions.getActionByClass<mrpt::obs::CActionRobotMovement3D>()) {
      odom_ = compose(odom_, poseOf(mrpt::poses::CPose2D(solid->rawOdometryIncrementReading)));
    } else {
      return;
    }
    has_odometry_ = true;
  }

  void observe(const mrpt::obs::CObservation& observation) {
    if (const auto* odometry = dynamic_cast<const mrpt::obs::CObservationOdometry*>(&observation)) {
      const Pose2D pose = poseOf(odometry->odometry);
      odom_ = {pose.x, pose.y, odom_.theta + wrapAngle(pose.theta - odom_.theta)};
      has_odometry_ = true;
    } else if (const auto* scan = dynamic_cast<const CObservation2DRangeScan*>(&observation)) {
      observe(*scan);
    }
  }

  void observe(const CObservation2DRangeScan& scan) {
    if (!label_) {
      label_ = scan.sensorLabel;
      log_.fan = fanOf(scan);
      log_.beams = scan.getScanSize();
    }
    if (scan.sensorLabel != *label_) return;
    if (scan.getScanSize() != log_.beams) {
      throw std::runtime_error("scans of " + std::to_string(log_.beams) + " and of " +
                               std::to_string(scan.getScanSize()) + " beams have the same label");
    }
    if (scan.timestamp == INVALID_TIMESTAMP) throw std::runtime_error("has a scan without a time");
    const double time = mrpt::Clock::toDouble(scan.timestamp);
    if (!log_.times.empty() && !(time > log_.times.back()))
      throw std::runtime_error("scans are not in order of time");
    log_.times.push_back(time);
    log_.odom.push_back(odom_);
    log_.ranges.push_back(rangesOf(scan));
  }

  LaserLog log_{};
  std::optional<std::string> label_;
  Pose2D odom_{0, 0, 0};
  bool has_odometry_ = false;
};

LaserLog read(const std::string& path) {
  const auto bytes = contents(path);
  mrpt::io::CMemoryStream stream;
  stream.assignMemoryNotOwn(bytes.data(), bytes.size());
  auto archive = mrpt::serialization::archiveFrom(stream);
  Reader reader;
  while (stream.getPosition() < bytes.size()) {
    const auto where = stream.getPosition();
    mrpt::serialization::CSerializable::Ptr object;
    try {
      object = archive.ReadObject();
    } catch (const std::exception&) {  // MRPT's text is a call stack
      throw std::runtime_error("is not a rawlog, or is damaged or cut off: the object at byte " +
                               std::to_string(where) + " (decompressed) cannot be read");
    }
    reader.take(object);
  }
  return reader.finish();
}

}  // namespace

LaserLog readRawlog(const std::string& path) {
  try {
    return read(path);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
}

}  // namespace kurumaisu
