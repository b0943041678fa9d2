// SPDX-License-Identifier: BSD-3-Clause
// The parts of the arena, each by itself; the whole is tested from Python.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include "raycast/arena.h"
#include "raycast/beams.h"
#include "raycast/bodies.h"
#include "raycast/layers.h"
#include "raycast/pool.h"

namespace test_arena {

namespace k = kurumaisu;

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

std::vector<k::Face> square(double side) {
  const double a = side / 2;
  return {{{-a, -a, a, -a}, 0, 1, 1, true},
          {{a, -a, a, a}, 0, 1, 1, true},
          {{a, a, -a, a}, 0, 1, 1, true},
          {{-a, a, -a, -a}, 0, 1, 1, true}};
}

k::Wall wall(double x, double z_low, double z_high, int tree) {
  return {{{x, -1, x, 1}, z_low, z_high, 1, true}, tree};
}

}  // namespace

TEST(BeamFinder, FindsEveryBeamWithinTheAngleAndFewOthers) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> angle(-k::kTurn / 2, k::kTurn / 2);
  std::uniform_real_distribution<double> any(-20, 20);
  for (int trial = 0; trial < 20000; ++trial) {
    const double increments[] = {0.0, 0.01, -0.3, k::kTurn / 16, 2.0, -k::kTurn, 1e-300};
    const k::Beams beams{any(rng), increments[trial % 7], static_cast<std::size_t>(trial % 40), 1.0};
    const double heading = any(rng);
    const double middle = angle(rng);
    const double half = std::abs(angle(rng)) * (trial % 3 ? 0.1 : 1.1);
    std::set<std::size_t> found;
    k::BeamFinder(beams, heading).within(middle, half, [&](std::size_t i) {
      EXPECT_LT(i, beams.samples);
      found.insert(i);
    });
    for (std::size_t i = 0; i < beams.samples; ++i) {
      const double direction = heading + beams.first + static_cast<double>(i) * beams.increment;
      const double off = std::abs(std::remainder(direction - middle, k::kTurn));
      if (off <= half) {
        EXPECT_TRUE(found.count(i)) << i << " of trial " << trial;
      } else if (off > half + 1e-6 && beams.increment != 0 && half < k::kTurn / 2 - 1e-6) {
        EXPECT_FALSE(found.count(i)) << i << " of trial " << trial;
      }
    }
  }
}

TEST(Bodies, NearFindsWhatASearchOfAllFinds) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> place(-200, 200);  // the grid repeats itself every 128 m
  k::Bodies bodies;
  for (int i = 0; i < 300; ++i) bodies.add(square(i % 50 ? 1.0 : 30.0), i);
  for (int round = 0; round < 30; ++round) {
    for (int i = 0; i < 300; ++i)
      if (bodies[i].present) bodies.place(i, {place(rng), place(rng), 0, place(rng)});
    bodies.remove(round * 7);
    for (const double reach : {0.0, 3.0, 50.0, 200.0, kInf}) {
      const double x = place(rng);
      const double y = place(rng);
      std::multiset<int> found;
      bodies.near(x, y, reach, [&](int body) { found.insert(body); });
      for (int i = 0; i < 300; ++i) {
        const auto& c = bodies.cylinder(i);
        const bool close = bodies[i].present && std::hypot(c.x - x, c.y - y) <= reach + c.radius;
        EXPECT_EQ(found.count(i), close ? 1U : 0U);
      }
    }
  }
}

TEST(Bodies, CylinderHoldsTheOutline) {
  k::Bodies bodies;
  const int body = bodies.add({{{1, 2, 4, 2}, 0, 1, 1, true}, {{4, 2, 4, 6}, 0, 1, 1, true}}, 0);
  bodies.place(body, {10, 20, 0, k::kTurn / 4});
  EXPECT_NEAR(bodies.cylinder(body).x, 10 - 4, 1e-12);
  EXPECT_NEAR(bodies.cylinder(body).y, 20 + 2.5, 1e-12);
  EXPECT_NEAR(bodies.cylinder(body).radius, 2.5, 1e-7);
  EXPECT_NEAR(bodies[body].placed[1].bx, 10 - 6, 1e-12);
  EXPECT_NEAR(bodies[body].placed[1].by, 20 + 4, 1e-12);
}

TEST(Layers, HeightsBetweenTheSameBoundsShareAScene) {
  const std::vector<k::Wall> walls{wall(1, 0, 0.5, 3), wall(2, 0.5, 1.0, 4), wall(3, 0, 1, 4)};
  k::Layers layers(walls);
  EXPECT_EQ(&layers.at(0.1, 0), &layers.at(0.4, 1));
  EXPECT_EQ(&layers.at(0.1, 0), &layers.at(0.0, -1));
  EXPECT_NE(&layers.at(0.1, 0), &layers.at(0.6, 0));
  EXPECT_EQ(layers.at(0.5, 0).members, (std::vector<std::int32_t>{0, 1, 2}));
  EXPECT_EQ(layers.at(0.5, 4).members, (std::vector<std::int32_t>{0}));
  EXPECT_EQ(&layers.at(0.6, 3), &layers.at(0.7, 0));  // what its tree owns is not there anyway
  EXPECT_TRUE(layers.at(1.5, 0).members.empty());
  EXPECT_EQ(&layers.at(1.5, 0), &layers.at(-1, 3));
}

TEST(Pool, DoesEverythingOnce) {
  for (const int threads : {1, 2, 5}) {
    k::Pool pool(threads);
    for (std::size_t count = 0; count < 300; ++count) {
      std::vector<std::atomic<int>> done(count);
      pool.run(count, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) ++done[i];
      });
      for (const auto& times : done) EXPECT_EQ(times, 1);
    }
  }
}

// Whoever takes a part while the others are already done with theirs must still find the work.
TEST(Pool, FewPartsManyTimes) {
  k::Pool pool(3);
  std::atomic<std::size_t> done{0};
  constexpr std::size_t kRounds = 20000;
  for (std::size_t round = 0; round < kRounds; ++round) {
    pool.run(3, [&](std::size_t begin, std::size_t end) { done += end - begin; });
  }
  EXPECT_EQ(done, 3 * kRounds);
}

TEST(Pool, WorksInAForkedProcess) {
  k::Pool pool(3);
  std::atomic<int> done{0};
  const auto work = [&](std::size_t begin, std::size_t end) { done += static_cast<int>(end - begin); };
  pool.run(100, work);
  const pid_t child = fork();
  if (child == 0) {
    alarm(10);
    pool.run(100, work);
    _exit(done == 200 ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

TEST(Arena, RefusesWhatItDoesNotKnow) {
  k::Arena arena({}, 1);
  const k::Pose pose{0, 0, 0, 0};
  EXPECT_THROW(arena.remove(0), std::invalid_argument);
  EXPECT_THROW(arena.setPoses({0}, &pose), std::invalid_argument);
  EXPECT_THROW(k::Arena({wall(kInf, 0, 1, 0)}, 1), std::invalid_argument);
  EXPECT_THROW(k::Arena({}, 0), std::invalid_argument);
}

TEST(Arena, ABodyMayBeNamedTwiceInAMove) {
  k::Arena arena({wall(2, 0, 1, 0)}, 1);
  const int body = arena.add(square(1), 1);
  const k::Pose poses[] = {{1, 0, 0, 0}, {2, 0, 0, 0}};
  bool stalled[2] = {false, false};
  arena.move({body, body}, poses, {}, stalled);
  EXPECT_FALSE(stalled[0]);
  EXPECT_TRUE(stalled[1]);
  arena.move({body, body}, poses, {1, 1}, stalled);
  EXPECT_TRUE(stalled[0] && stalled[1]);
  double range = 0;
  double returned = 0;
  arena.cast({{{-1, 0, 0.5, 0}, 0}}, kInf, &range, &returned);
  EXPECT_DOUBLE_EQ(range, 1.5);
  EXPECT_DOUBLE_EQ(returned, 1.0);
}

}  // namespace test_arena
