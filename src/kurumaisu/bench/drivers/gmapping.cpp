// SPDX-License-Identifier: BSD-3-Clause
// Maps a log with gmapping's library, as slam_gmapping calls it. Compiled against an installed openslam_gmapping.
#include <gmapping/gridfastslam/gridslamprocessor.h>
#include <gmapping/sensor/sensor_odometry/odometrysensor.h>
#include <gmapping/utils/stat.h>

#include <algorithm>
#include <iostream>
#include <sstream>

#include "slam_log.h"

using GMapping::GridSlamProcessor;
using GMapping::OrientedPoint;

namespace {

struct Settings {
  explicit Settings(Arguments& from)
      : delta(from.number("delta")), extent(from.number("extent")), occ_thresh(from.number("occ_thresh")) {}
  double delta, extent, occ_thresh;
};

void configure(GridSlamProcessor& slam, Arguments& from, const Settings& settings, const Log& log,
               const OrientedPoint& start) {
  const double range = log.range_max - 0.01;  // as slam_gmapping's defaults of maxRange and maxUrange
  slam.setMatchingParameters(range, range, from.number("sigma"), static_cast<int>(from.number("kernelSize")),
                             from.number("lstep"), from.number("astep"),
                             static_cast<int>(from.number("iterations")), from.number("lsigma"),
                             from.number("ogain"), static_cast<unsigned>(from.number("lskip")));
  slam.setMotionModelParameters(from.number("srr"), from.number("srt"), from.number("str"),
                                from.number("stt"));
  slam.setUpdateDistances(from.number("linearUpdate"), from.number("angularUpdate"),
                          from.number("resampleThreshold"));
  slam.setUpdatePeriod(from.number("temporalUpdate"));
  slam.setgenerateMap(false);
  const double half = settings.extent;
  slam.GridSlamProcessor::init(static_cast<unsigned>(from.number("particles")), -half, -half, half, half,
                               settings.delta, start);
  slam.setllsamplerange(from.number("llsamplerange"));
  slam.setllsamplestep(from.number("llsamplestep"));
  slam.setlasamplerange(from.number("lasamplerange"));
  slam.setlasamplestep(from.number("lasamplestep"));
  slam.setminimumScore(from.number("minimumScore"));
}

std::vector<double> readings(const Log& log, std::size_t scan) {
  std::vector<double> out(log.ranges(scan), log.ranges(scan) + log.beams);
  for (double& range : out) {
    if (!(range >= log.range_min)) range = log.range_max;
  }
  return out;
}

/// The map of the best particle, as slam_gmapping publishes it.
Cells mapOf(const GridSlamProcessor& slam, const GMapping::RangeSensor& laser,
            const std::vector<double>& angles, const Settings& settings, double range) {
  GMapping::ScanMatcher matcher;
  matcher.setLaserParameters(static_cast<unsigned>(angles.size()), const_cast<double*>(angles.data()),
                             laser.getPose());
  matcher.setlaserMaxRange(range);
  matcher.setusableRange(range);
  matcher.setgenerateMap(true);
  const double half = settings.extent;
  GMapping::ScanMatcherMap map(GMapping::Point(0, 0), -half, -half, half, half, settings.delta);
  for (auto* node = slam.getParticles()[slam.getBestParticleIndex()].node; node != nullptr;
       node = node->parent) {
    if (node->reading == nullptr) continue;
    matcher.invalidateActiveArea();
    matcher.computeActiveArea(map, node->pose, &(*node->reading)[0]);
    matcher.registerScan(map, node->pose, &(*node->reading)[0]);
  }
  const GMapping::Point corner = map.map2world(GMapping::IntPoint(0, 0));
  Cells out{map.getMapSizeX(), map.getMapSizeY(), settings.delta, corner.x, corner.y, {}};
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const double occupied = map.cell(GMapping::IntPoint(x, y));
      out.values.push_back(occupied < 0 ? -1 : (occupied > settings.occ_thresh ? 100 : 0));
    }
  }
  return out;
}

void run(int count, char** words) {
  Arguments from(count, words);
  const Log log(from.text("log"));
  const Settings settings(from);
  const auto seed = static_cast<unsigned long>(from.number("seed"));
  const std::string poses_to = from.text("poses"), map_to = from.text("map");
  const double width = log.angle_increment * static_cast<double>(log.beams - 1);
  const Pose centred = compose(log.base_from_laser, {0, 0, log.angle_min + width / 2});
  const double start_of_work = processorTime();
  GMapping::RangeSensor laser("FLASER", static_cast<unsigned>(log.beams), log.angle_increment,
                              OrientedPoint(0, 0, 0), 0.0, log.range_max - 0.01);
  std::ostringstream chatter;
  GridSlamProcessor slam(chatter);
  GMapping::SensorMap sensors;
  sensors.insert(std::make_pair(laser.getName(), &laser));
  slam.setSensorMap(sensors);
  const Pose first = compose(log.odom(0), centred);
  configure(slam, from, settings, log, OrientedPoint(first.x, first.y, first.theta));
  from.end();
  GMapping::sampleGaussian(1, seed);
  std::vector<double> angles;
  for (std::size_t i = 0; i < log.beams; ++i) {
    angles.push_back(-width / 2 + log.angle_increment * static_cast<double>(i));
  }
  for (std::size_t i = 0; i < log.scans; ++i) {
    const std::vector<double> ranges = readings(log, i);
    GMapping::RangeReading reading(static_cast<unsigned>(log.beams), ranges.data(), &laser, log.time(i));
    const Pose odom = compose(log.odom(i), centred);
    reading.setPose(OrientedPoint(odom.x, odom.y, odom.theta));
    slam.processScan(reading);
    chatter.str("");
  }
  std::vector<double> poses(3 * log.scans, std::nan(""));
  for (auto* node = slam.getParticles()[slam.getBestParticleIndex()].node; node != nullptr;
       node = node->parent) {
    if (node->reading == nullptr) continue;
    std::size_t i = 0;
    while (i + 1 < log.scans && log.time(i) < node->reading->getTime() - 1e-6) ++i;
    const Pose base = compose({node->pose.x, node->pose.y, node->pose.theta}, inverse(centred));
    poses[3 * i] = base.x, poses[3 * i + 1] = base.y, poses[3 * i + 2] = base.theta;
  }
  const Cells map = mapOf(slam, laser, angles, settings, log.range_max - 0.01);
  printCosts(processorTime() - start_of_work, log);
  writeDoubles(poses_to, poses);
  std::vector<double> cells{double(map.width), double(map.height), map.resolution, map.x, map.y};
  cells.insert(cells.end(), map.values.begin(), map.values.end());
  writeDoubles(map_to, cells);
}

}  // namespace

int main(int count, char** words) { return exitStatus(run, count, words); }
