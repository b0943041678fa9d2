// SPDX-License-Identifier: BSD-3-Clause
// What may go wrong around the mapper.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "mapper_values.h"
#include "mapping_drive.h"
#include "slam/mapping/report.h"

namespace test_mapping {

namespace k = kurumaisu;
using namespace room::mapping;  // NOLINT: a test

namespace {

double deviation(const k::Mapper::Estimate& estimate) {
  return std::sqrt(estimate.covariance[0] + estimate.covariance[4]);
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

// A neighbour is the next reading, not the next beam.
TEST(Faults, WithFiveOfSixBeamsMissingItIsAsWithASixthOfTheBeams) {
  const auto blind = [](const Mischief& mischief) {
    k::Mapper mapper(room::settings(), 1);
    const auto out = drive(mapper, 0, 20, mischief);
    EXPECT_LT(errorAt(out.back().map_from_base, 19.9), 0.1);
    return std::count_if(out.begin(), out.end(), [](const auto& estimate) { return estimate.blind; });
  };
  const auto missing = blind([](Moment& moment) {
    for (int i = 0; i < room::kBeams; ++i) {
      if (i % 6 != 0) moment.scan.ranges[i] = std::nanf("");
    }
  });
  const auto coarse = blind([](Moment& moment) {
    std::vector<float> ranges;
    for (int i = 0; i < room::kBeams; i += 6) ranges.push_back(moment.scan.ranges[i]);
    moment.scan.ranges = std::move(ranges);
    moment.scan.fan.angle_increment *= 6;
    moment.scan.fan.time_increment *= 6;
  });
  EXPECT_LE(missing, coarse + 2);
  EXPECT_LT(missing, 10);
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
      {[](State& s) { s.clock_problem = "/clock"; }, 2, "MAPPING_NO_CLOCK: /clock"},
      {[](State& s) { s.start_problem = "explains 3 %"; }, 2, "MAPPING_START: explains 3 %"},
      {[](State& s) { s.silence = 3; }, 2, "MAPPING_NO_SCAN"},
      {[](State& s) { s.paused = true; }, 1, "MAPPING_PAUSED"},
      {[](State& s) { s.missing = "no odometry: odom to base_link"; }, 2,
       "MAPPING_NO_TRANSFORM: scans come, but no odom"},
      {[](State& s) { s.full = true; }, 2, "MAPPING_TOO_LARGE"},
      {[](State& s) { s.blind = true; }, 1, "MAPPING_BLIND"},
      {[](State& s) { s.jumps = 2; }, 1, "MAPPING_ODOMETRY_JUMP: jumps rejected: 2"},
      {[](State& s) { s.skipped = 7; }, 1, "MAPPING_TOO_SLOW: scans skipped: 7"},
      {[](State& s) { s.dropped = 1, s.reason = "tilted"; }, 1,
       "MAPPING_DROPPED: scans dropped: 1, the last: tilted"}};
  for (const auto& [change, level, words] : cases) {
    EXPECT_EQ(said(change).level, level) << words;
    EXPECT_EQ(said(change).summary.find(words), 0U) << said(change).summary;
  }
}

}  // namespace test_mapping
