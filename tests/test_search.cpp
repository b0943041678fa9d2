// SPDX-License-Identifier: BSD-3-Clause
// The search of a whole map against one that looks up every reading on its own.
#include <gtest/gtest.h>

#include <algorithm>

#include "slam/localization/search.h"
#include "slam_room.h"

namespace test_search {

namespace k = kurumaisu;

namespace {

const k::ReadingSettings kReading{60, 30, 0.52, 0.05, 0.95, 0.05, 0.4, 0.2};
const k::LaserError kError{1, 0, {0.002334, -0.000488, 0.000199}, 0.001, 0.06, 5.6};

k::RecoverySettings recovery(int positions_per_scan, int places) {
  return {0.002, 0.15, 0.5, 0.88, 0.93, 1000, 1.5, 0.05, 0.2, 0.105, positions_per_scan, places};
}

/// A room whose map begins anywhere in a cell, at time t.
struct Case {
  explicit Case(double t)
      : field(room::mapOf(room::kWalls, 0.05), room::kMapFromGrid, 0.4), sensor(field, kReading, kError) {
    std::mt19937 noise(3);
    beams = k::pick(room::scanAt(t, noise), {0, 0, 0}, kReading);
  }

  k::Field field;
  k::Sensor sensor;
  k::Beams beams;
};

/// Sum of the codes at which readings end, every second one of 60, seen from a pose of the map.
int misfit(const Case& at, const k::Pose2D& map_from_base) {
  const k::Pose2D pose = k::between(room::kMapFromGrid, map_from_base);
  const std::size_t every = (at.beams.beams.size() + 39) / 40;
  int sum = 0;
  for (std::size_t i = 0; i < at.beams.beams.size(); i += every) {
    const k::Pose2D end = k::compose(pose, {at.beams.beams[i].x, at.beams.beams[i].y, 0});
    sum += at.field.code(static_cast<float>(end.x / 0.05), static_cast<float>(end.y / 0.05));
  }
  return sum;
}

/// The least misfit of any free position a stride apart and any heading.
int leastMisfit(const Case& at) {
  int least = std::numeric_limits<int>::max();
  for (int y = 2; y < at.field.height(); y += 4) {
    for (int x = 2; x < at.field.width(); x += 4) {
      if (!at.field.free(x, y)) continue;
      for (int heading = 0; heading < 60; ++heading) {
        const k::Pose2D pose{(x + 0.5) * 0.05, (y + 0.5) * 0.05, heading * 2 * M_PI / 60};
        least = std::min(least, misfit(at, k::compose(room::kMapFromGrid, pose)));
      }
    }
  }
  return least;
}

TEST(Combed, HasEveryCodeAndIsFarBeyondTheEdges) {
  const Case at(0);
  constexpr int kReach = 13;
  for (const int stride : {1, 3, 4, 7}) {
    k::Combed combed(at.field, stride, kReach);
    for (int y = -2; y < at.field.height() + 2; ++y) {
      for (int x = -kReach; x < at.field.width() + kReach; ++x) {
        const auto expected = at.field.code(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
        ASSERT_EQ(*combed.at(x, y), expected) << x << " " << y;
        if (x - 3 * stride < -kReach) continue;
        ASSERT_EQ(combed.at(x - 3 * stride, y)[3], expected) << x << " " << y;
      }
    }
  }
}

TEST(Combed, ForgetsRows) {
  const Case at(0);
  k::Combed combed(at.field, 4, 2);
  const int above = combed.at(10, 12)[0];
  combed.forgetBelow(12);
  EXPECT_EQ(combed.at(10, 12)[0], above);
  combed.forgetBelow(at.field.height() + 5);
}

TEST(Search, BestIsTheLeastMisfitOfAll) {
  for (const double t : {0.0, 7.0, 19.0}) {
    const Case at(t);
    const auto settings = recovery(5000, 300);
    k::Search search(at.sensor, settings, at.beams);
    while (!search.step()) {
    }
    const auto poses = search.poses();
    ASSERT_FALSE(poses.empty());
    // Readings that end at the border of a cell may round otherwise here.
    EXPECT_NEAR(misfit(at, poses.front()), leastMisfit(at), 40);
    const auto near = [t](const k::Pose2D& pose) {
      const k::Pose2D off = k::between(room::truth(t), pose);
      return std::hypot(off.x, off.y) < 0.25 && std::abs(k::wrapAngle(off.theta)) < 0.12;
    };
    EXPECT_TRUE(std::any_of(poses.begin(), poses.end(), near)) << t;
  }
}

TEST(Search, SlicesDoNotChangeWhatIsFound) {
  const Case at(7);
  const auto whole = recovery(1000000, 20);
  const auto sliced = recovery(7, 20);
  k::Search one(at.sensor, whole, at.beams);
  k::Search many(at.sensor, sliced, at.beams);
  EXPECT_TRUE(one.step());
  int steps = 1;
  double progress = 0;
  for (; !many.step(); ++steps) {
    EXPECT_GE(many.progress(), progress);
    progress = many.progress();
  }
  EXPECT_GT(steps, 100);
  EXPECT_EQ(many.progress(), 1);
  const auto expected = one.poses();
  const auto found = many.poses();
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].x, expected[i].x);
    EXPECT_EQ(found[i].y, expected[i].y);
    EXPECT_EQ(found[i].theta, expected[i].theta);
  }
}

TEST(Search, AMapOfOneCellIsSearched) {
  const k::OccupancyGrid grid{0.05, 0, 0, 1, 1, {0}};
  const k::Field field(grid, {0, 0, 0}, 0.4);
  const k::Sensor sensor(field, kReading, kError);
  const auto settings = recovery(5000, 300);
  const Case at(0);
  k::Search search(sensor, settings, at.beams);
  EXPECT_TRUE(search.step());
  EXPECT_LE(search.poses().size(), 1U);
}

}  // namespace

}  // namespace test_search
