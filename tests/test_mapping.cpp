// SPDX-License-Identifier: BSD-3-Clause
// What may go wrong around the mapper, and how it goes on from what it saved.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <sstream>
#include <stdexcept>

#include "mapper_values.h"
#include "slam/mapper.h"
#include "slam/mapping_report.h"
#include "slam/pose.h"
#include "slam_room.h"

namespace k = kurumaisu;

namespace {

constexpr double kStep = 0.1;  // [s] between scans

struct Moment {
  double t;
  k::Scan scan;
  k::Pose2D start, end;
};
using Mischief = std::function<void(Moment&)>;

/// Drives from a time of the truth on; what the mapper says of every scan.
std::vector<k::Mapper::Estimate> drive(k::Mapper& mapper, double from, double to,
                                       const Mischief& mischief = {}) {
  std::mt19937 noise(7);
  room::Wheels wheels;
  std::vector<k::Mapper::Estimate> out;
  for (double t = from; t < to - kStep / 2; t += kStep) {
    Moment moment{t, room::scanAt(t, noise), wheels.at(t), wheels.at(t + room::kUrg.time_increment * 681)};
    if (mischief) mischief(moment);
    out.push_back(mapper.add(moment.scan, moment.start, moment.end));
  }
  return out;
}

k::Pose2D mapFromRoom() {
  room::Wheels wheels;
  return k::compose(wheels.at(0), k::between(room::truth(0), {0, 0, 0}));
}

double errorAt(const k::Pose2D& map_from_base, double t) {
  const k::Pose2D error = k::between(k::compose(mapFromRoom(), room::truth(t)), map_from_base);
  return std::hypot(error.x, error.y);
}

double deviation(const k::Mapper::Estimate& estimate) {
  return std::sqrt(estimate.covariance[0] + estimate.covariance[4]);
}

k::Gaussian about(const k::Pose2D& pose) {
  k::Gaussian out{pose, Eigen::Matrix3d::Zero()};
  out.covariance.diagonal() << 0.04, 0.04, 0.01;
  return out;
}

/// A folder of its own for each test.
class Files : public testing::Test {
 protected:
  void SetUp() override {
    char name[] = "/tmp/kurumaisu_mapping_XXXXXX";
    folder_ = mkdtemp(name);
  }
  void TearDown() override { EXPECT_EQ(std::system(("rm -r " + folder_).c_str()), 0); }

  static std::string contents(const std::string& path) {
    std::ostringstream out;
    out << std::ifstream(path).rdbuf();
    return out.str();
  }
  static bool exists(const std::string& path) { return access(path.c_str(), F_OK) == 0; }

  std::string folder_;
};

std::string problemOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST(Faults, AJumpOfOdometryIsSaidAndNotBelieved) {
  k::Mapper mapper(room::settings(), 1);
  k::Pose2D off{0, 0, 0};
  int jumps = 0;
  const auto out = drive(mapper, 0, 10, [&](Moment& moment) {
    if (moment.t > 4.95 && moment.t < 5.05) off = {7, -3, 2};
    if (moment.t > 7.95 && moment.t < 8.05) off = {-40, 2, -1};
    moment.start = k::compose(off, moment.start);
    moment.end = k::compose(off, moment.end);
  });
  for (const auto& estimate : out) jumps += estimate.jumped;
  EXPECT_EQ(jumps, 2);
  EXPECT_LT(errorAt(out.back().map_from_base, 9.9), 0.05);
}

TEST(Faults, AJumpWithinAScanDoesNotBendIt) {
  k::Mapper mapper(room::settings(), 1);
  const auto out = drive(mapper, 0, 6, [](Moment& moment) {
    if (moment.t > 4.95) moment.start = k::compose({3, 0, 1}, moment.start);
    if (moment.t > 4.85) moment.end = k::compose({3, 0, 1}, moment.end);
  });
  EXPECT_LT(errorAt(out.back().map_from_base, 5.9), 0.05);
}

TEST(Faults, BurstsOfWheelSlipAreCaughtByTheScans) {
  k::Mapper mapper(room::settings(), 1);
  double slipped = 0;
  const auto out = drive(mapper, 0, 12, [&](Moment& moment) {
    if (std::fmod(moment.t, 3) > 2.5) slipped += 0.1;  // the wheels spin at 1 m/s
    moment.start = k::compose(moment.start, {slipped, 0, 0});
    moment.end = k::compose(moment.end, {slipped, 0, 0});
  });
  EXPECT_LT(errorAt(out.back().map_from_base, 11.9), 0.08);
}

TEST(Faults, MostScansMayBeMissing) {
  k::Mapper mapper(room::settings(), 1);
  std::mt19937 noise(7), dice(3);
  room::Wheels wheels;
  k::Pose2D last{};
  double at = 0;
  for (double t = 0; t < 20; t += kStep) {
    const k::Pose2D start = wheels.at(t);
    const k::Pose2D end = wheels.at(t + room::kUrg.time_increment * 681);
    if (t > 0 && dice() % 5 != 0) continue;
    last = mapper.add(room::scanAt(t, noise), start, end).map_from_base;
    at = t;
  }
  EXPECT_LT(errorAt(last, at), 0.1);
}

TEST(Faults, MostReadingsMayBeMissing) {
  k::Mapper mapper(room::settings(), 1);
  std::mt19937 dice(5);
  const auto out = drive(mapper, 0, 20, [&](Moment& moment) {
    for (float& range : moment.scan.ranges) range = dice() % 5 == 0 ? range : std::nanf("");
  });
  EXPECT_LT(errorAt(out.back().map_from_base, 19.9), 0.25);
}

TEST(Faults, OdometryThatStandsStillIsMadeUpForByTheScans) {
  k::Mapper mapper(room::settings(), 1);
  const k::Pose2D rest = room::Wheels().at(0);
  const auto out = drive(mapper, 0, 20, [&](Moment& moment) { moment.start = moment.end = rest; });
  EXPECT_LT(errorAt(out.back().map_from_base, 19.9), 0.15);
}

/// Range [m] at which a ray meets somebody of 0.2 m radius, or infinity.
double meets(const k::Pose2D& ray, double x, double y) {
  const k::Pose2D seen = k::between(ray, {x, y, 0});
  const double inside = 0.2 * 0.2 - seen.y * seen.y;
  return seen.x > 0 && inside > 0 ? seen.x - std::sqrt(inside) : std::numeric_limits<double>::infinity();
}

TEST(Faults, PeopleAroundTheChairDoNotMoveIt) {
  k::Mapper mapper(room::settings(), 1);
  int hidden = 0;
  const auto out = drive(mapper, 0, 20, [&](Moment& moment) {
    const k::Pose2D laser = k::compose(room::truth(moment.t), room::kUrg.base_from_laser);
    for (int i = 0; i < room::kBeams; ++i) {
      const k::Pose2D ray{laser.x, laser.y,
                          laser.theta + room::kUrg.angle_min + room::kUrg.angle_increment * i};
      for (int person = 0; person < 5; ++person) {  // to and fro through the room, at a metre a second
        const double along = 3.5 * std::sin(moment.t / 3.5 + person);
        const double across = -3.0 + 1.1 * person;
        const auto range = static_cast<float>(meets(ray, along, across));
        if (!(range > 0.1F && range < moment.scan.ranges[i])) continue;
        moment.scan.ranges[i] = range;
        ++hidden;
      }
    }
  });
  EXPECT_GT(hidden, 0.1 * 200 * room::kBeams);
  EXPECT_LT(errorAt(out.back().map_from_base, 19.9), 0.15);
}

TEST(Faults, WithoutReadingsThePoseGetsUncertainAndIsFoundAgain) {
  k::Mapper mapper(room::settings(), 1);
  const auto out = drive(mapper, 0, 12, [](Moment& moment) {
    if (moment.t > 5 && moment.t < 8) moment.scan.ranges.assign(room::kBeams, std::nanf(""));
  });
  EXPECT_FALSE(out[45].blind);
  EXPECT_TRUE(out[70].blind);
  const double before = deviation(out[45]);
  const double blind = deviation(out[79]);
  EXPECT_GT(blind, 5 * before);
  EXPECT_GT(2.5 * blind, errorAt(out[79].map_from_base, 7.9));  // honest
  EXPECT_FALSE(out.back().blind);
  EXPECT_LT(errorAt(out.back().map_from_base, 11.9), 0.25);
}

TEST(Faults, AMapThatWouldBeTooLargeStaysAsItIs) {
  auto values = room::values();
  values["most_cells"] = 8e4;  // 14 x 14 m: the first scans fit
  k::Mapper mapper(k::makeSettings([&values](const std::string& key) { return values.at(key); }), 1);
  const auto out = drive(mapper, 0, 20);
  int full = 0, grown = 0;
  for (const auto& estimate : out) {
    full += estimate.full;
    grown += estimate.map_updated;
    EXPECT_FALSE(estimate.full && estimate.map_updated);
  }
  EXPECT_GT(full, 0);
  EXPECT_GT(grown, 1);
  EXPECT_LT(errorAt(out.back().map_from_base, 19.9), 0.1);  // it goes on saying where the chair is
  const auto grid = mapper.grid();
  EXPECT_LE(grid.width * grid.height, 80000);
  EXPECT_GT(grid.width, 40);
}

TEST(Faults, TimeAloneMayRunTheFilter) {
  auto values = room::values();
  values["localise_time"] = 0.5;
  k::Mapper mapper(k::makeSettings([&values](const std::string& key) { return values.at(key); }), 1);
  int runs = 0;
  for (int i = 0; i < 40; ++i) {
    k::Scan scan = room::scanAt(0, room::kUrg, room::kBeams, nullptr);
    scan.stamp = 0.1 * i;
    runs += mapper.add(scan, {0, 0, 0}, {0, 0, 0}).localised;
  }
  EXPECT_GE(runs, 6);
  EXPECT_LE(runs, 9);
}

TEST(Path, NodesAndParticlesBelongTogether) {
  k::Mapper mapper(room::settings(), 1);
  EXPECT_TRUE(mapper.nodes().empty());
  EXPECT_TRUE(mapper.particles().empty());
  EXPECT_EQ(mapper.entropy(), 0);
  const auto out = drive(mapper, 0, 8);
  const auto nodes = mapper.nodes();
  EXPECT_GT(nodes.size(), 8U);
  const auto trajectory = mapper.trajectory();
  for (const auto& node : nodes) {
    const auto step = static_cast<std::size_t>(std::lround(node.stamp / kStep));
    EXPECT_NEAR(trajectory[step].pose.x, node.pose.x, 1e-9);
    EXPECT_GE(node.covariance[0], 0);
  }
  EXPECT_GT(nodes.back().covariance[0], 0);
  const auto particles = mapper.particles();
  ASSERT_EQ(particles.size(), 10U);
  double sum = 0;
  for (const auto& each : particles) sum += each.weight;
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_GT(mapper.entropy(), 0);
  EXPECT_LE(mapper.entropy(), std::log(10) + 1e-9);
}

TEST_F(Files, GoesOnFromItsSimplemap) {
  const std::string path = folder_ + "/room.simplemap";
  std::size_t kept = 0;
  {
    k::Mapper mapper(room::settings(), 1);
    drive(mapper, 0, 20);
    kept = mapper.keys().size();
    k::writeSimplemap(path, mapper.keys());
  }
  const auto keys = k::readSimplemap(path);
  ASSERT_EQ(keys.size(), kept);
  EXPECT_GT(kept, 10U);
  k::Mapper mapper(room::settings(), 2);
  auto saved = k::savedMapOf(keys, room::settings());
  EXPECT_GT(saved.grid.width, 100);
  // Somewhere else, with odometry of its own; told half a step and some degrees wrong.
  mapper.resume(saved, about(k::compose(mapFromRoom(), k::compose(room::truth(20), {0.2, -0.15, 0.08}))));
  EXPECT_EQ(mapper.grid().width, saved.grid.width);
  const auto out = drive(mapper, 20, 30, [](Moment& moment) {
    moment.start = k::compose({50, -20, 2}, moment.start);
    moment.end = k::compose({50, -20, 2}, moment.end);
  });
  EXPECT_LT(errorAt(out.front().map_from_base, 20), 0.05);
  EXPECT_LT(errorAt(out.back().map_from_base, 29.9), 0.08);
  EXPECT_GT(mapper.keys().size(), kept);
  EXPECT_EQ(mapper.keys().front().scan.ranges.size(), keys.front().scan.ranges.size());
}

TEST_F(Files, ASimplemapKeepsEveryReadingAndPose) {
  const k::Scan scan{
      12.5, {-2.0, 0.035, 0, 5.6, {0.3, 0.05, 0.1}}, {1.0F, 2.5F, std::nanf(""), INFINITY, 3.0F}};
  k::Fan clockwise = scan.fan;
  clockwise.angle_increment = -0.035;
  const std::array<double, 9> covariance{0.01, 0.001, 0, 0.001, 0.02, 0.002, 0, 0.002, 0.003};
  const std::string path = folder_ + "/two.simplemap";
  k::writeSimplemap(
      path, {{{1, 2, 0.5}, covariance, scan}, {{3, 4, -3}, covariance, {13, clockwise, scan.ranges}}});
  const auto keys = k::readSimplemap(path);
  ASSERT_EQ(keys.size(), 2U);
  EXPECT_NEAR(keys[1].map_from_base.theta, -3, 1e-9);
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(keys[0].covariance[i], covariance[i], 1e-9);
  for (const auto& key : keys) {
    EXPECT_EQ(key.scan.ranges[1], 2.5F);
    EXPECT_TRUE(std::isnan(key.scan.ranges[2]));
    EXPECT_TRUE(std::isinf(key.scan.ranges[3]));
  }
  // The same beams, wherever zero lies.
  const auto bearing = [](const k::Scan& from, int i) {
    return k::wrapAngle(from.fan.base_from_laser.theta + from.fan.angle_min + from.fan.angle_increment * i);
  };
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(bearing(keys[0].scan, i), bearing(scan, i), 1e-5);
    EXPECT_NEAR(bearing(keys[1].scan, i), bearing({13, clockwise, scan.ranges}, i), 1e-5);
  }
}

TEST_F(Files, AStartThatDoesNotFitIsSaidAndALaterOneMay) {
  k::Mapper first(room::settings(), 1);
  drive(first, 0, 10);
  const k::SavedMap saved{first.grid(), {}};
  k::Mapper mapper(room::settings(), 2);
  mapper.resume(saved, about(k::compose(mapFromRoom(), room::truth(10))));
  const k::Scan scan = room::scanAt(10, room::kUrg, room::kBeams, nullptr);
  k::Scan other = scan;
  for (std::size_t i = 0; i < other.ranges.size(); ++i)
    other.ranges[i] = 0.3F + 0.004F * static_cast<float>(i);
  EXPECT_THROW(mapper.add(other, {0, 0, 0}, {0, 0, 0}), k::StartError);
  EXPECT_TRUE(mapper.trajectory().empty());
  EXPECT_LT(errorAt(mapper.add(scan, {0, 0, 0}, {0, 0, 0}).map_from_base, 10), 0.05);
}

TEST_F(Files, GoingOnRefusesWhatMakesNoSense) {
  k::Mapper mapper(room::settings(), 1);
  k::OccupancyGrid grid{0.05, 0, 0, 2, 2, {0, 0, 100, 0}};
  k::Gaussian wide = about({0, 0, 0});
  wide.covariance(0, 0) = 4;
  EXPECT_NE(problemOf([&] { mapper.resume({grid, {}}, wide); }).find("within 1 m"), std::string::npos);
  EXPECT_NE(problemOf([&] {
              mapper.resume({{0.05, 0, 0, 0, 0, {}}, {}}, about({}));
            }).find("empty"),
            std::string::npos);
  const k::OccupancyGrid large{0.05, 0, 0, 10000, 10000, std::vector<std::int8_t>(100000000)};
  EXPECT_NE(problemOf([&] { mapper.resume({large, {}}, about({})); }).find("500"), std::string::npos);
  grid.cells = {0, 0, 0, 0};
  mapper.resume({grid, {}}, about({}));
  const k::Scan scan = room::scanAt(0, room::kUrg, room::kBeams, nullptr);
  EXPECT_NE(problemOf([&] { mapper.add(scan, {}, {}); }).find("no walls"), std::string::npos);
}

TEST_F(Files, WhatCannotBeReadIsNamed) {
  EXPECT_NE(problemOf([&] { k::readSimplemap(folder_ + "/none"); }).find("/none: cannot be read"),
            std::string::npos);
  const std::string garbage = folder_ + "/garbage";
  std::ofstream(garbage) << "no map at all";
  EXPECT_EQ(problemOf([&] { k::readSimplemap(garbage); }).find(garbage + ": "), 0U);
}

TEST_F(Files, APairIsWhatMapServerReads) {
  const k::OccupancyGrid grid{0.05, -1.5, 2, 3, 2, {0, 100, -1, 19, 66, 50}};
  k::writeMapPair(folder_ + "/it's", grid);
  EXPECT_EQ(contents(folder_ + "/it's.pgm"), std::string("P5\n3 2\n255\n\xfe\x00\xcd\xfe\x00\xcd", 17));
  const std::string text = contents(folder_ + "/it's.yaml");
  EXPECT_NE(text.find("image: 'it''s.pgm'\nresolution: 0.05\norigin: [-1.5, 2, 0.0]"), std::string::npos)
      << text;
  EXPECT_NE(text.find("occupied_thresh: 0.65\nfree_thresh: 0.196"), std::string::npos) << text;
  EXPECT_FALSE(exists(folder_ + "/it's.pgm.part"));
}

TEST_F(Files, WhatCannotBeWrittenIsNamedAndTheOldFileStays) {
  const k::OccupancyGrid grid{0.05, 0, 0, 1, 1, {0}};
  const std::string missing = folder_ + "/missing/map";
  EXPECT_NE(problemOf([&] {
              k::writeMapPair(missing, grid);
            }).find(missing + ".pgm: cannot be written: No such file"),
            std::string::npos);
  k::Mapper mapper(room::settings(), 1);
  EXPECT_NE(problemOf([&] { k::writeSimplemap(missing, mapper.keys()); }).find("nothing has been mapped"),
            std::string::npos);
  EXPECT_NE(problemOf([&] { k::writeMapPair(missing, mapper.grid()); }).find("nothing has been mapped"),
            std::string::npos);
  std::ofstream(folder_ + "/map.pgm") << "old";
  ASSERT_EQ(mkdir((folder_ + "/map.pgm.part").c_str(), 0700), 0);  // for root as well
  EXPECT_NE(problemOf([&] { k::writeMapPair(folder_ + "/map", grid); }), "");
  EXPECT_EQ(contents(folder_ + "/map.pgm"), "old");
}

TEST(MappingReport, SaysTheWorstFirst) {
  k::MappingState good;
  good.begun = true;
  good.silence_limit = 2;
  EXPECT_EQ(k::judge(good).level, 0);
  const auto said = [&good](const std::function<void(k::MappingState&)>& change) {
    k::MappingState state = good;
    change(state);
    return k::judge(state);
  };
  using State = k::MappingState;
  EXPECT_EQ(said([](State& s) { s.begun = false; }).summary, "no scan yet");
  const std::vector<std::tuple<std::function<void(State&)>, int, std::string>> cases{
      {[](State& s) { s.start_problem = "explains 3 %"; }, 2, "MAPPING_START: explains 3 %"},
      {[](State& s) { s.silence = 3; }, 2, "MAPPING_NO_SCAN"},
      {[](State& s) { s.paused = true; }, 1, "MAPPING_PAUSED"},
      {[](State& s) { s.missing = "no odometry: odom to base_link"; }, 2,
       "MAPPING_NO_TRANSFORM: scans come, but no odom"},
      {[](State& s) { s.full = true; }, 2, "MAPPING_TOO_LARGE"},
      {[](State& s) { s.blind = true; }, 1, "MAPPING_BLIND"},
      {[](State& s) { s.jumps = 2; }, 1, "MAPPING_ODOMETRY_JUMP: jumps not believed: 2"},
      {[](State& s) { s.skipped = 7; }, 1, "MAPPING_TOO_SLOW: scans skipped: 7"},
      {[](State& s) { s.dropped = 1, s.reason = "tilted"; }, 1,
       "MAPPING_DROPPED: scans dropped: 1, the last: tilted"}};
  for (const auto& [change, level, words] : cases) {
    EXPECT_EQ(said(change).level, level) << words;
    EXPECT_EQ(said(change).summary.find(words), 0U) << said(change).summary;
  }
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
