// SPDX-License-Identifier: BSD-3-Clause
// The mapper in a room whose scans are computed here, beam by beam.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <thread>

#include "mapper_values.h"
#include "slam/basics/pose.h"
#include "slam/mapping/mapper.h"
#include "slam_room.h"

namespace test_slam {

namespace k = kurumaisu;

namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

double distanceToWall(double x, double y) {
  auto nearest = static_cast<double>(kInf);
  for (const room::Wall& wall : room::kWalls) {
    const double ex = wall.x1 - wall.x0;
    const double ey = wall.y1 - wall.y0;
    const double part = ((x - wall.x0) * ex + (y - wall.y0) * ey) / (ex * ex + ey * ey);
    const double clipped = std::fmin(1, std::fmax(0, part));
    nearest = std::fmin(nearest, std::hypot(x - wall.x0 - clipped * ex, y - wall.y0 - clipped * ey));
  }
  return nearest;
}

struct Drive {
  std::vector<k::StampedPose> trajectory;
  std::vector<k::Pose2D> online;
  k::OccupancyGrid grid;
};

Drive drive(std::uint32_t seed, double seconds, const k::Fan& fan = room::kUrg, int beams = room::kBeams) {
  k::Mapper mapper(room::settings(), seed);
  std::mt19937 noise(7);
  room::Wheels odometry;
  Drive out;
  for (int i = 0; i < static_cast<int>(seconds * 10); ++i) {
    const double t = 0.1 * i;
    const k::Pose2D start = odometry.at(t);
    const k::Pose2D end = odometry.at(t + fan.time_increment * (beams - 1));
    out.online.push_back(mapper.add(room::scanAt(t, fan, beams, &noise), start, end).map_from_base);
  }
  out.trajectory = mapper.trajectory();
  out.grid = mapper.grid();
  return out;
}

/// The room's frame as seen from the map's: the map begins as odometry.
k::Pose2D mapFromRoom() {
  room::Wheels odometry;
  return k::compose(odometry.at(0), k::between(room::truth(0), {0, 0, 0}));
}

struct Error {
  double position, heading;
};

Error errorOf(const k::Pose2D& map_from_base, double t) {
  const k::Pose2D error = k::between(k::compose(mapFromRoom(), room::truth(t)), map_from_base);
  return {std::hypot(error.x, error.y), std::abs(k::wrapAngle(error.theta))};
}

/// Share of the occupied cells that are not within this distance of a wall.
double strayShare(const k::OccupancyGrid& grid, double distance) {
  const k::Pose2D room_from_map = k::between(mapFromRoom(), {0, 0, 0});
  int occupied = 0;
  int stray = 0;
  for (int i = 0; i < grid.width * grid.height; ++i) {
    if (grid.cells[i] < 65) continue;
    const int row = i / grid.width;
    const k::Pose2D cell = k::compose(room_from_map, {grid.x + (i % grid.width + 0.5) * grid.resolution,
                                                      grid.y + (row + 0.5) * grid.resolution, 0});
    ++occupied;
    stray += distanceToWall(cell.x, cell.y) > distance;
  }
  EXPECT_GT(occupied, 40);
  return static_cast<double>(stray) / occupied;
}

}  // namespace

TEST(Deskew, GivesTheScanThatAChairAtRestWouldTake) {
  const double t = 3.0;  // turning at 0.5 rad/s
  const k::Scan rolling = room::scanAt(t, room::kUrg, room::kBeams, nullptr);
  k::Fan at_once = room::kUrg;
  at_once.time_increment = 0;
  const k::Scan expected = room::scanAt(t, at_once, room::kBeams, nullptr);
  const k::Scan got = k::deskew(
      rolling, k::between(room::truth(t), room::truth(t + room::kUrg.time_increment * (room::kBeams - 1))));
  int skewed = 0;
  int wrong = 0;
  for (int i = 0; i < room::kBeams; ++i) {
    skewed += std::abs(rolling.ranges[i] - expected.ranges[i]) > 0.003F;
    // Both infinite is right; edges of what hides something else may fall to the neighbouring beam.
    const bool same =
        got.ranges[i] == expected.ranges[i] || std::abs(got.ranges[i] - expected.ranges[i]) < 0.002F;
    wrong += !same && !std::isnan(got.ranges[i]);
  }
  EXPECT_GT(skewed, room::kBeams / 3);
  EXPECT_LT(wrong, 10);
}

TEST(Deskew, DoesSoWithWhatASparseScanHas) {
  const double t = 3.0;
  k::Scan sparse = room::scanAt(t, room::kUrg, room::kBeams, nullptr);
  k::Fan at_once = room::kUrg;
  at_once.time_increment = 0;
  const k::Scan expected = room::scanAt(t, at_once, room::kBeams, nullptr);
  for (int i = 0; i < room::kBeams; ++i) {
    if (i % 3 != 0) sparse.ranges[i] = std::nanf("");
  }
  const k::Scan got = k::deskew(
      sparse, k::between(room::truth(t), room::truth(t + room::kUrg.time_increment * (room::kBeams - 1))));
  int there = 0;
  int wrong = 0;
  for (int i = 0; i < room::kBeams; ++i) {
    there += !std::isnan(got.ranges[i]);
    wrong += std::isfinite(got.ranges[i]) && !(std::abs(got.ranges[i] - expected.ranges[i]) < 0.004F);
  }
  EXPECT_NEAR(3 * there, room::kBeams, 30);
  EXPECT_LT(wrong, 10);
}

TEST(Dropouts, AreFewBeamsWithoutAReturn) {
  const float none = std::nanf("");
  const k::Scan scan{
      0, {-1.0, 0.1, 0, 4.0, {0, 0, 0}}, {kInf, 1.0F, kInf, none, 5.0F, kInf, 3.0F, kInf, kInf, kInf}};
  const auto kept = [&scan](int most) {
    std::string out;
    for (const float range : k::withoutDropouts(scan, most).ranges) out += std::isnan(range) ? '-' : 'x';
    return out;
  };
  EXPECT_EQ(kept(0), "xxx-xxxxxx");
  EXPECT_EQ(kept(1), "-x--xxxxxx");
  EXPECT_EQ(kept(2), "-x----xxxx");
  EXPECT_EQ(kept(3), "-x----x---");
}

TEST(Deskew, WithoutMotionKeepsEveryReading) {
  k::Scan scan{0, {-1.0, 0.5, 0, 4.0, {0.3, 0, 0}}, {1.0F, 1.02F, std::nanf(""), kInf, 5.0F}};
  const k::Scan got = k::deskew(scan, {0, 0, 0});
  EXPECT_NEAR(got.ranges[0], 1.0, 1e-6);
  EXPECT_NEAR(got.ranges[1], 1.02, 1e-6);
  EXPECT_TRUE(std::isnan(got.ranges[2]));
  EXPECT_EQ(got.ranges[3], kInf);
  EXPECT_EQ(got.ranges[4], kInf);  // beyond range_max
}

TEST(Deskew, WithoutMotionNoFanLosesARay) {
  for (int trial = 0; trial < 200; ++trial) {
    const double increment = 0.006 + 1.7e-6 * trial;
    k::Scan scan{
        0, {-340 * increment, increment, 0, 5.6, {0.3, 0.05, 0.1 * trial}}, std::vector<float>(682, 2.0F)};
    for (const float range : k::deskew(scan, {0, 0, 0}).ranges) ASSERT_NEAR(range, 2.0, 1e-5) << trial;
  }
}

TEST(Mapper, FollowsTheChairThroughBadOdometry) {
  const Drive out = drive(1, 40);
  double worst = 0;
  for (const auto& [stamp, pose] : out.trajectory) worst = std::fmax(worst, errorOf(pose, stamp).position);
  EXPECT_LT(worst, 0.03);
  for (std::size_t i = 0; i < out.online.size(); ++i) {
    EXPECT_LT(errorOf(out.online[i], 0.1 * static_cast<double>(i)).position, 0.04);
  }
  EXPECT_LT(errorOf(out.trajectory.back().pose, 39.9).heading, 0.01);
  // The test is about something: odometry alone is far off.
  room::Wheels odometry;
  EXPECT_GT(errorOf(odometry.at(39.9), 39.9).heading, 0.15);
}

TEST(Mapper, MapsTheWallsWhereTheyAre) {
  const Drive out = drive(1, 40);
  EXPECT_LT(strayShare(out.grid, 0.08), 0.01);
  EXPECT_DOUBLE_EQ(out.grid.resolution, 0.05);
  EXPECT_NEAR(out.grid.x / 0.05, std::nearbyint(out.grid.x / 0.05), 1e-9);
}

// One scan, whose pose is known. With beams 2 degrees apart, a fan that is off by one beam puts walls 0.1 m
// off at 3 m, and one that is taken for symmetric turns them by 26 degrees.
TEST(Mapper, PutsEveryBeamOfAnAsymmetricFanWhereItPoints) {
  EXPECT_EQ(strayShare(drive(1, 0.1, {-2.0, 0.035, 0, 5.6, {0.3, 0.05, 0.1}}, 88).grid, 0.04), 0);
}

TEST(Mapper, PutsEveryBeamOfAClockwiseFanWhereItPoints) {
  EXPECT_EQ(strayShare(drive(1, 0.1, {1.1, -0.035, 0, 5.6, {0.3, 0.05, 0.1}}, 88).grid, 0.04), 0);
}

TEST(Mapper, BeamsWithoutReturnClearAndUnknownOnesDoNot) {
  for (const bool no_return : {true, false}) {
    k::Mapper mapper(room::settings(), 1);
    k::Scan scan{0, {-1.0, 0.01, 0, 4.0, {0, 0, 0}}, std::vector<float>(201, 2.0F)};
    for (int i = 80; i < 120; ++i) scan.ranges[i] = no_return ? kInf : std::nanf("");
    mapper.add(scan, {0, 0, 0}, {0, 0, 0});
    const k::OccupancyGrid grid = mapper.grid();
    const int column = static_cast<int>(std::floor((3.5 - grid.x) / grid.resolution));
    const int row = static_cast<int>(std::floor((0.02 - grid.y) / grid.resolution));
    const bool seen = column < grid.width && grid.cells[row * grid.width + column] >= 0;
    EXPECT_EQ(seen, no_return);
    if (seen) {
      EXPECT_LT(grid.cells[row * grid.width + column], 50);
    }
    const double edge = grid.x + grid.width * grid.resolution;
    EXPECT_NEAR(edge, no_return ? 4.0 : 2.0, 0.06);
  }
}

TEST(Mapper, ADropoutOfInfClearsNoMoreThanOneOfNaN) {
  std::vector<std::vector<std::int8_t>> maps;
  for (const float dropout : {kInf, std::nanf("")}) {
    k::Mapper mapper(room::settings(), 1);
    k::Scan scan{0, {-1.0, 0.01, 0, 4.0, {0, 0, 0}}, std::vector<float>(201, 2.0F)};
    for (int i = 0; i < 201; i += 2) scan.ranges[i] = dropout;
    mapper.add(scan, {0, 0, 0}, {0, 0, 0});
    maps.push_back(mapper.grid().cells);
  }
  EXPECT_EQ(maps[0], maps[1]);
}

TEST(Mapper, IsTheSameForASeedInAnyThread) {
  const Drive first = drive(5, 8);
  Drive second;
  std::thread([&second] {
    drive(6, 4);  // leaves the thread's generator in another state
    second = drive(5, 8);
  }).join();
  ASSERT_EQ(first.trajectory.size(), second.trajectory.size());
  for (std::size_t i = 0; i < first.trajectory.size(); ++i) {
    EXPECT_EQ(first.trajectory[i].pose.x, second.trajectory[i].pose.x);
    EXPECT_EQ(first.trajectory[i].pose.y, second.trajectory[i].pose.y);
    EXPECT_EQ(first.trajectory[i].pose.theta, second.trajectory[i].pose.theta);
  }
  EXPECT_EQ(first.grid.cells, second.grid.cells);
  EXPECT_NE(first.trajectory.back().pose.x, drive(6, 8).trajectory.back().pose.x);
}

TEST(Mapper, RefusesWhatMakesNoSense) {
  k::Mapper mapper(room::settings(), 1);
  EXPECT_TRUE(mapper.trajectory().empty());
  EXPECT_EQ(mapper.grid().width, 0);
  const k::Scan scan = room::scanAt(1.0, room::kUrg, room::kBeams, nullptr);
  mapper.add(scan, {0, 0, 0}, {0, 0, 0});
  EXPECT_THROW(mapper.add(scan, {0, 0, 0}, {0, 0, 0}), std::invalid_argument);
  k::Scan bad = scan;
  bad.stamp = 2;
  bad.fan.angle_increment = 0;
  EXPECT_THROW(mapper.add(bad, {0, 0, 0}, {0, 0, 0}), std::invalid_argument);
  bad = scan;
  bad.stamp = 2;
  bad.ranges.resize(1);
  EXPECT_THROW(mapper.add(bad, {0, 0, 0}, {0, 0, 0}), std::invalid_argument);
  bad = scan;
  bad.stamp = 2;
  EXPECT_THROW(mapper.add(bad, {std::nan(""), 0, 0}, {0, 0, 0}), std::invalid_argument);
  EXPECT_EQ(mapper.trajectory().size(), 1U);
}

TEST(Mapper, SurvivesScansThatSeeNothing) {
  k::Mapper mapper(room::settings(), 1);
  for (int i = 0; i < 20; ++i) {
    const k::Pose2D odom{0.2 * i, 0, 0};
    const auto estimate =
        mapper.add({0.1 * i, room::kUrg, std::vector<float>(room::kBeams, kInf)}, odom, odom);
    EXPECT_NEAR(estimate.map_from_base.x, odom.x, 0.1);
  }
}

TEST(Settings, EveryKeyIsNamedWhenItIsWrong) {
  for (const std::string& name : k::settingNames()) {
    auto table = room::values();
    table[name] = -1;
    try {
      k::makeSettings([&table](const std::string& key) { return table.at(key); });
      FAIL() << name << " may be -1";
    } catch (const std::invalid_argument& error) {
      EXPECT_EQ(std::string(error.what()).find(name + ": "), 0U) << error.what();
    }
  }
}

TEST(Settings, CountsAreWhole) {
  auto table = room::values();
  table["particles"] = 2.5;
  EXPECT_THROW(k::makeSettings([&table](const std::string& key) { return table.at(key); }),
               std::invalid_argument);
}

}  // namespace test_slam
