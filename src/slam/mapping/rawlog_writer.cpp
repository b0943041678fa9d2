// SPDX-License-Identifier: BSD-3-Clause
#include <mrpt/core/Clock.h>
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>

#include <stdexcept>

#include "slam/basics/pose.h"
#include "slam/mapping/observation.h"
#include "slam/mapping/rawlog.h"
#include "slam/mapping/whole_file.h"

namespace kurumaisu {
namespace {

mrpt::obs::CActionCollection actionOf(const Pose2D& motion, double stamp) {
  // Its noise is MRPT's usual one: whoever reads the file has options of his own.
  mrpt::obs::CActionRobotMovement2D movement;
  movement.timestamp = mrpt::Clock::fromDouble(stamp);
  movement.computeFromOdometry(mrpt::poses::CPose2D(motion.x, motion.y, wrapAngle(motion.theta)), {});
  mrpt::obs::CActionCollection actions;
  actions.insert(movement);
  return actions;
}

/// Bytes of a packed file, as far as it is whole.
std::uint64_t unpackedSize(const std::string& name) {
  mrpt::io::CFileGZInputStream file;
  if (!file.open(name)) return 0;
  std::vector<char> piece(1U << 20U);
  std::uint64_t size = 0;
  for (std::size_t got = piece.size(); got == piece.size(); size += got) {
    got = file.Read(piece.data(), piece.size());
    if (got > piece.size()) return 0;  // damaged
  }
  return size;
}

bool write(const std::string& name, const LaserLog& log) {
  mrpt::io::CFileGZOutputStream file;
  if (!file.open(name)) return false;
  auto archive = mrpt::serialization::archiveFrom(file);
  Pose2D before = log.odom.front();
  for (std::size_t i = 0; i < log.times.size(); ++i) {
    archive << actionOf(between(before, log.odom[i]), log.times[i]);
    before = log.odom[i];
    mrpt::obs::CSensoryFrame frame;
    frame.insert(keptObservation({log.times[i], log.fan, log.ranges[i]}));
    archive << frame;
  }
  const std::uint64_t written = file.getPosition();
  file.close();
  return unpackedSize(name) == written;  // MRPT does not hear of a disk that is full when it closes the file
}

}  // namespace

void writeRawlog(const std::string& path, const LaserLog& log) {
  if (log.times.empty()) throw std::runtime_error(path + ": there is no scan to write");
  replaceWhole({{path, [&log](const std::string& name) { return write(name, log); }}});
}

}  // namespace kurumaisu
