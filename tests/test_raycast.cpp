// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "raycast/scene.h"

namespace test_raycast {

namespace k = kurumaisu;

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
const double kPi = std::acos(-1.0);

std::vector<k::Segment> box(double w, double h) {
  return {{0, 0, w, 0}, {w, 0, w, h}, {w, h, 0, h}, {0, h, 0, 0}};
}

/// Independent oracle: Cramer's rule over all segments.
double bruteForce(const std::vector<k::Segment>& segments, double x, double y, double angle,
                  double max_range) {
  double best = kInf;
  const double dx = std::cos(angle);
  const double dy = std::sin(angle);
  for (const auto& s : segments) {
    const double ex = s.bx - s.ax;
    const double ey = s.by - s.ay;
    const double det = ex * dy - ey * dx;
    if (det == 0) continue;
    const double t = (ex * (s.ay - y) - ey * (s.ax - x)) / det;
    const double f = (dx * (s.ay - y) - dy * (s.ax - x)) / det;
    if (t >= 0 && f >= 0 && f <= 1 && t <= max_range) best = std::fmin(best, t);
  }
  return best;
}

}  // namespace

TEST(Scene, WallsOfARoomAtKnownDistances) {
  const k::Scene scene(box(6, 5));
  EXPECT_DOUBLE_EQ(scene.cast(1, 2, 0, kInf).range, 5);
  EXPECT_DOUBLE_EQ(scene.cast(1, 2, kPi / 2, kInf).range, 3);
  EXPECT_DOUBLE_EQ(scene.cast(1, 2, kPi, kInf).range, 1);
  EXPECT_DOUBLE_EQ(scene.cast(1, 2, -kPi / 2, kInf).range, 2);
  EXPECT_NEAR(scene.cast(1, 2, kPi / 4, kInf).range, 3 * std::sqrt(2.0), 1e-14);
  EXPECT_EQ(scene.cast(1, 2, 0, kInf).segment, 1);
}

TEST(Scene, MaximumRange) {
  const k::Scene scene(box(6, 5));
  EXPECT_DOUBLE_EQ(scene.cast(1, 2, 0, 5.0).range, 5);
  EXPECT_EQ(scene.cast(1, 2, 0, 4.999).range, kInf);
  EXPECT_EQ(scene.cast(1, 2, 0, 4.999).segment, -1);
}

TEST(Scene, FromOutsideAndPastIt) {
  const k::Scene scene(box(6, 5));
  EXPECT_DOUBLE_EQ(scene.cast(-2, 2, 0, kInf).range, 2);
  EXPECT_EQ(scene.cast(-2, 2, kPi, kInf).range, kInf);
  EXPECT_EQ(scene.cast(-2, 7, 0, kInf).range, kInf);
}

TEST(Scene, OnAWallAndAlongIt) {
  const k::Scene wall({{2, 1, 5, 1}});
  EXPECT_DOUBLE_EQ(wall.cast(3, 1, kPi / 2, kInf).range, 0);
  EXPECT_DOUBLE_EQ(wall.cast(0, 1, 0, kInf).range, 2);
  EXPECT_EQ(wall.cast(6, 1, 0, kInf).range, kInf);
}

TEST(Scene, NothingToMeet) {
  const k::Scene empty({});
  EXPECT_EQ(empty.cast(0, 0, 1, kInf).range, kInf);
  const k::Scene scene(box(6, 5));
  EXPECT_EQ(scene.cast(std::nan(""), 0, 1, kInf).range, kInf);
  EXPECT_EQ(scene.cast(1, 1, std::nan(""), kInf).range, kInf);
}

TEST(Scene, RefusesSegmentsThatAreNotFinite) {
  EXPECT_THROW(k::Scene({{0, 0, 1, 1}, {0, 0, kInf, 1}}), std::invalid_argument);
}

// Beams aimed at the very corners of a closed ring: any gap between neighbours would let one escape.
TEST(Scene, NoGapBetweenNeighbours) {
  std::vector<k::Segment> ring;
  std::vector<double> xs, ys;
  constexpr int kCorners = 997;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2 * kPi * i / kCorners;
    xs.push_back(3.1 * std::cos(angle) + 0.3);
    ys.push_back(2.3 * std::sin(angle) - 0.7);
  }
  for (int i = 0; i < kCorners; ++i) {
    const int j = (i + 1) % kCorners;
    ring.push_back({xs[i], ys[i], xs[j], ys[j]});
  }
  const k::Scene scene(ring);
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> place(-0.5, 0.5);
  for (int trial = 0; trial < 20; ++trial) {
    const double x = place(rng);
    const double y = place(rng);
    for (int i = 0; i < kCorners; ++i) {
      const double expected = std::hypot(xs[i] - x, ys[i] - y);
      EXPECT_NEAR(scene.cast(x, y, std::atan2(ys[i] - y, xs[i] - x), kInf).range, expected, 1e-9);
    }
  }
}

TEST(Scene, AgreesWithBruteForce) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> place(-5, 5);
  std::uniform_real_distribution<double> turn(-4, 4);
  for (const int count : {1, 2, 7, 60, 500}) {
    for (int scene_number = 0; scene_number < 10; ++scene_number) {
      std::vector<k::Segment> segments;
      for (int i = 0; i < count; ++i) {
        const double x = place(rng);
        const double y = place(rng);
        const double size = scene_number % 2 ? 1.0 : 0.1;
        segments.push_back({x, y, x + size * place(rng), y + size * place(rng)});
      }
      const k::Scene scene(segments);
      for (int i = 0; i < 2000; ++i) {
        const double x = 1.5 * place(rng);
        const double y = 1.5 * place(rng);
        const double angle = turn(rng);
        const double max_range = i % 3 ? 20.0 : 2.0;
        const double expected = bruteForce(segments, x, y, angle, max_range);
        const double range = scene.cast(x, y, angle, max_range).range;
        if (std::isinf(expected)) {
          EXPECT_EQ(range, expected);
        } else {
          EXPECT_NEAR(range, expected, 1e-9);
        }
      }
    }
  }
}

namespace {

/// Crossing sticks, closed boxes (some within others, some smaller than the gap between two beams) and a fence of pixels.
std::vector<k::Segment> clutter(std::mt19937& rng, int sticks, int boxes, int pixels) {
  std::uniform_real_distribution<double> place(-5, 5);
  std::uniform_real_distribution<double> length(-1, 1);
  std::vector<k::Segment> segments = {{-6, -6, 6, -6}, {6, -6, 6, 6}, {6, 6, -6, 6}, {-6, 6, -6, -6}};
  for (int i = 0; i < sticks; ++i) {
    const double x = place(rng);
    const double y = place(rng);
    segments.push_back({x, y, x + length(rng), y + length(rng)});
  }
  const auto add_box = [&](double x, double y, double w, double h) {
    for (const auto& s : box(w, h)) segments.push_back({x + s.ax, y + s.ay, x + s.bx, y + s.by});
  };
  for (int i = 0; i < boxes; ++i) {
    const double size = std::pow(10.0, length(rng) - 1);
    add_box(place(rng), place(rng), size, size);
  }
  for (int i = 0; i < pixels; ++i)
    add_box(std::floor(place(rng)) / 8, std::floor(8 * place(rng)) / 8, 0.125, 0.125);
  return segments;
}

}  // namespace

// The beams between two probes are computed, not cast: nothing may hide there.
TEST(Scene, AFanIsItsBeams) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> place(-7, 7);
  std::uniform_real_distribution<double> turn(-4, 4);
  const int counts[][3] = {{0, 0, 0},  {1, 3, 0},   {40, 0, 0},   {0, 60, 0},
                           {0, 0, 80}, {5, 30, 30}, {400, 200, 0}};
  for (int trial = 0; trial < 70; ++trial) {
    const auto& count = counts[trial % 7];
    const k::Scene scene(clutter(rng, count[0], count[1], count[2]));
    for (int fan = 0; fan < 30; ++fan) {
      const k::Pose2D origin{place(rng), place(rng), turn(rng)};
      const double first = turn(rng);
      const double increment = fan % 5 ? 0.002 * turn(rng) : 6.283185307179586 / 360;
      const std::size_t n = fan % 5 ? 700 : 361;
      const double max_range = fan % 2 ? kInf : 4.0;
      std::vector<k::Hit> hits(n);
      scene.castFan(origin, first, increment, n, max_range, hits.data());
      for (std::size_t i = 0; i < n; ++i) {
        const double angle = origin.theta + (first + static_cast<double>(i) * increment);
        const k::Hit alone = scene.cast(origin.x, origin.y, angle, max_range);
        ASSERT_EQ(hits[i].segment, alone.segment) << trial << " " << fan << " " << i;
        if (alone.segment < 0) {
          ASSERT_EQ(hits[i].range, kInf);
        } else {
          ASSERT_NEAR(hits[i].range, alone.range, 1e-12 * (1 + alone.range));
        }
      }
    }
  }
}

}  // namespace test_raycast
