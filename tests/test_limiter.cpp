// SPDX-License-Identifier: BSD-3-Clause
// The limiter against differences of its samples, and against every schedule that a search can find.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <queue>
#include <random>
#include <utility>
#include <vector>

#include "base/limiter.h"

namespace test_limiter {

namespace k = kurumaisu;

namespace {

constexpr double kTiny = 1e-9;

struct Sample {
  double t;
  double rate;
};

/// What differences of samples say; independent of how they were made.
void expectBounded(const std::vector<Sample>& samples, const k::RampLimits& limits) {
  const double hardest = std::max(limits.acceleration, limits.deceleration);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const auto [t0, r0] = samples[i - 1];
    const auto [t1, r1] = samples[i];
    const double slope = (r1 - r0) / (t1 - t0);
    double most = hardest;  // through rest both may take part
    if (r0 * r1 >= 0) most = std::abs(r1) > std::abs(r0) ? limits.acceleration : limits.deceleration;
    ASSERT_LE(std::abs(slope), most * (1 + kTiny) + kTiny) << "sample " << i << " at " << t1;
    if (i < 2) continue;
    const auto [t2, r2] = samples[i - 2];
    const double jerk = 2 * (slope - (r0 - r2) / (t0 - t2)) / (t1 - t2);
    const double rounding = 1e-12 / ((t1 - t0) * (t1 - t2)) + 1e-12 / ((t0 - t2) * (t1 - t2));
    ASSERT_LE(std::abs(jerk), limits.jerk * (1 + kTiny) + rounding) << "sample " << i << " at " << t1;
  }
}

/// Times [s] of the ticks of a loop at 50 Hz, on a computer that has other things to do.
double interval(std::mt19937_64& random) {
  const double u = std::uniform_real_distribution<>(0, 1)(random);
  return u < 0.7 ? 0.02 : u < 0.9 ? 0.001 + 0.05 * u * u : 0.1 + 0.5 * (u - 0.9);
}

k::RampLimits drawLimits(std::mt19937_64& random) {
  const auto draw = [&random] { return std::exp(std::uniform_real_distribution<>(-1.5, 1.5)(random)); };
  return {draw(), draw(), 3 * draw()};
}

/// Seconds of continuous time until the ramp has come to its target, to within a step.
double duration(k::Ramp ramp, double target, double step) {
  int steps = 0;
  for (; ramp.rate() != target || ramp.reach() != std::abs(target); ++steps) {
    if (steps > 1000000) return INFINITY;
    ramp.advance(target, step);
  }
  return steps * step;
}

const k::Limits kRide{1.5, 0.8, 1.2, {0.8, 1.2, 3.0}, {1.5, 2.5, 8.0}, 0.6, false};

}  // namespace

TEST(Ramp, NoSequenceOfTargetsAndIntervalsBreaksABound) {
  std::mt19937_64 random(1);
  for (int run = 0; run < 400; ++run) {
    const k::RampLimits limits = drawLimits(random);
    k::Ramp ramp(limits);
    std::vector<Sample> samples{{0, 0}};
    double target = 0;
    for (int i = 0; i < 600; ++i) {
      if (random() % 25 == 0)
        target = std::uniform_real_distribution<>(-1.5, 1.5)(random) * (random() % 5 != 0);
      const double dt = interval(random);
      ramp.advance(target, dt);
      samples.push_back({samples.back().t + dt, ramp.rate()});
    }
    expectBounded(samples, limits);
    if (HasFatalFailure()) FAIL() << "run " << run;
  }
}

TEST(Ramp, TargetsThatJumpAtEverySampleBreakNoneEither) {
  std::mt19937_64 random(2);
  for (int run = 0; run < 100; ++run) {
    const k::RampLimits limits = drawLimits(random);
    k::Ramp ramp(limits);
    std::vector<Sample> samples{{0, 0}};
    for (int i = 0; i < 600; ++i) {
      ramp.advance(random() % 2 ? 1.0 : -1.0, 0.02);
      samples.push_back({samples.back().t + 0.02, ramp.rate()});
    }
    expectBounded(samples, limits);
    if (HasFatalFailure()) FAIL() << "run " << run;
  }
}

TEST(Ramp, ArrivesWithoutOvershootAndStays) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<> uniform(-1.5, 1.5);
  for (int run = 0; run < 2000; ++run) {
    k::Ramp ramp(drawLimits(random));
    ramp.put(uniform(random));
    const double start = ramp.rate(), target = run % 7 ? uniform(random) : 0.0;
    double last = start;
    for (int i = 0; ramp.rate() != target; ++i) {
      ASSERT_LT(i, 5000) << start << " to " << target;
      ramp.advance(target, interval(random));
      ASSERT_GE(ramp.rate(), std::min(last, target) - 1e-12) << start << " to " << target;
      ASSERT_LE(ramp.rate(), std::max(last, target) + 1e-12) << start << " to " << target;
      last = ramp.rate();
    }
    ramp.advance(target, 1.0);
    ASSERT_EQ(ramp.rate(), target);
  }
}

TEST(Ramp, SamplesOfOneWayAreTheSameWhateverTheIntervals) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<> uniform(-1.5, 1.5);
  for (int run = 0; run < 500; ++run) {
    const k::RampLimits limits = drawLimits(random);
    const double target = uniform(random);
    k::Ramp whole(limits), parts(limits);
    whole.put(uniform(random));
    parts.put(whole.rate());
    double t = 0;
    for (int i = 0; i < 30; ++i) {
      const double dt = interval(random);
      parts.advance(target, dt);
      t += dt;
    }
    whole.advance(target, t);
    ASSERT_NEAR(whole.rate(), parts.rate(), 1e-9);
  }
}

TEST(Ramp, AWholeStopByHand) {
  // 1.2 m/s, 1.2 m/s^2, 3 m/s^3: 0.4 s into the deceleration, 0.6 s of it, 0.4 s out.
  k::Ramp ramp({0.8, 1.2, 3.0});
  ramp.put(1.2);
  ramp.advance(0, 0.4);
  EXPECT_NEAR(ramp.rate(), 0.96, 1e-12);
  ramp.advance(0, 0.6);
  EXPECT_NEAR(ramp.rate(), 0.24, 1e-12);
  ramp.advance(0, 0.399);
  EXPECT_GT(ramp.rate(), 0);
  ramp.advance(0, 0.001 + 1e-9);
  EXPECT_EQ(ramp.rate(), 0);
  // A stop too short for the full deceleration: 0.03 m/s = peak^2 / jerk, peak 0.3 m/s^2, 0.2 s.
  ramp.put(0.03);
  ramp.advance(0, 0.1);
  EXPECT_NEAR(ramp.rate(), 0.015, 1e-12);
  ramp.advance(0, 0.1 + 1e-9);
  EXPECT_EQ(ramp.rate(), 0);
}

/// Schedules of jerks -1, 0, +1, one a second: rates are halves, slopes whole, so a search finds them all.
TEST(Ramp, NoScheduleThatKeepsTheBoundsIsFaster) {
  for (const auto& [up, down] : {std::pair(2, 2), {2, 4}, {3, 2}, {1, 3}}) {
    const int most = 40;  // half rates
    std::map<std::pair<int, int>, int> seconds{{{0, 0}, 0}};
    for (int from = -most; from <= most; from += 8) {
      std::map<std::pair<int, int>, int> found{{{from, 0}, 0}};
      std::queue<std::pair<int, int>> queue({{from, 0}});
      while (!queue.empty()) {
        const auto [rate, slope] = queue.front();
        queue.pop();
        for (int jerk = -1; jerk <= 1; ++jerk) {
          const int next_slope = slope + jerk, next_rate = rate + 2 * slope + jerk;
          if (std::abs(next_rate) > 2 * most) continue;
          bool allowed = true;
          for (double part = 0; part <= 1; part += 0.0625) {  // in between as well
            const double r = 0.5 * rate + part * (slope + 0.5 * jerk * part), s = slope + jerk * part;
            allowed &= std::abs(s) <= (r * s < -1e-9 ? down : up) + 1e-9;
          }
          if (!allowed || found.count({next_rate, next_slope})) continue;
          found[{next_rate, next_slope}] = found[{rate, slope}] + 1;
          queue.push({next_rate, next_slope});
        }
      }
      for (int to = -most; to <= most; to += 4) {
        ASSERT_TRUE(found.count({to, 0}));
        k::Ramp ramp({double(up), double(down), 1.0});
        ramp.put(0.5 * from);
        const double took = duration(ramp, 0.5 * to, 1.0 / 64);
        const int best = found[{to, 0}];
        EXPECT_LE(took, best + 1.0 / 64) << 0.5 * from << " to " << 0.5 * to << ", " << up << " " << down;
        EXPECT_GT(took, best - 4.0) << 0.5 * from << " to " << 0.5 * to;  // the search has whole seconds only
      }
    }
  }
}

TEST(Ramp, OtherLimitsOnTheWayJumpNothingAndOvershootNothing) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<> uniform(0.2, 1.5);
  for (int run = 0; run < 1000; ++run) {
    k::Ramp ramp(drawLimits(random));
    const double target = uniform(random);
    ramp.advance(target, uniform(random));
    const double before = ramp.rate(), reach = ramp.reach();
    const k::RampLimits limits = drawLimits(random);
    ramp.configure(limits);
    EXPECT_EQ(ramp.rate(), before);
    EXPECT_LE(ramp.reach(), reach * (1 + kTiny));
    std::vector<Sample> samples{{0, before}};
    for (int i = 0; i < 300; ++i) {
      ramp.advance(target, 0.02);
      samples.push_back({samples.back().t + 0.02, ramp.rate()});
      ASSERT_LE(ramp.rate(), target * (1 + kTiny));
    }
    expectBounded(samples, limits);
    if (HasFatalFailure()) FAIL() << "run " << run;
  }
}

TEST(Ramp, OtherLimitsInTheMiddleOfAReversalHoldBeyondRest) {
  std::mt19937_64 random(8);
  std::uniform_real_distribution<> uniform(0.2, 1.5);
  for (int run = 0; run < 1000; ++run) {
    k::Ramp ramp(drawLimits(random));
    ramp.put(uniform(random));
    while (ramp.rate() > 0.1) ramp.advance(-1.0, 0.01);
    const k::RampLimits limits = drawLimits(random);
    ramp.configure(limits);
    std::vector<Sample> samples{{0, ramp.rate()}};
    for (int i = 0; i < 200; ++i) {
      ramp.advance(-1.0, 0.02);
      samples.push_back({samples.back().t + 0.02, ramp.rate()});
    }
    expectBounded(samples, limits);
    if (HasFatalFailure()) FAIL() << "run " << run;
  }
}

TEST(Limiter, BothAxesTogetherKeepEveryBoundForAnyCommands) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<> uniform(-2.0, 2.0);
  for (int run = 0; run < 300; ++run) {
    k::Limits limits{uniform(random) + 2.5, uniform(random) + 2.5, uniform(random) + 2.5,
                     drawLimits(random),    drawLimits(random),    0.1 + 0.2 * (uniform(random) + 2),
                     run % 2 == 0};
    k::Limiter limiter(limits);
    std::vector<Sample> v{{0, 0}}, w{{0, 0}};
    k::Rates command;
    for (int i = 0; i < 1000; ++i) {
      if (random() % 30 == 0) command = {uniform(random), uniform(random)};
      const double dt = interval(random);
      const k::Rates rates = limiter.advance(command, k::Limiter::kNoCap, dt);
      v.push_back({v.back().t + dt, rates.v});
      w.push_back({w.back().t + dt, rates.w});
      ASSERT_LE(std::abs(rates.v * rates.w), limits.lateral_acceleration * (1 + kTiny));
      ASSERT_LE(rates.v, limits.v_forward + 1e-12);
      ASSERT_GE(rates.v, -limits.v_reverse - 1e-12);
      ASSERT_LE(std::abs(rates.w), limits.w + 1e-12);
    }
    expectBounded(v, limits.v_ramp);
    expectBounded(w, limits.w_ramp);
    if (HasFatalFailure()) FAIL() << "run " << run;
  }
}

TEST(Limiter, EveryCommandIsComeToInTheEnd) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<> uniform(-2.0, 2.0);
  k::Limiter limiter(kRide);
  for (int run = 0; run < 500; ++run) {
    const k::Rates command{uniform(random), uniform(random)};
    const k::Rates wanted = k::shaped(kRide, command, k::Limiter::kNoCap);
    for (int i = 0; i < 400; ++i) limiter.advance(command, k::Limiter::kNoCap, 0.02);
    ASSERT_NEAR(limiter.rates().v, wanted.v, 1e-9);
    ASSERT_NEAR(limiter.rates().w, wanted.w, 1e-9);
  }
}

TEST(Limiter, ATurnWaitsForTheSpeedToComeDown) {
  k::Limiter limiter(kRide);
  for (int i = 0; i < 200; ++i) limiter.advance({1.5, 0.0}, k::Limiter::kNoCap, 0.02);
  ASSERT_EQ(limiter.rates().v, 1.5);
  double widest = 0;
  for (int i = 0; i < 200; ++i) {
    const k::Rates rates = limiter.advance({0.3, 1.2}, k::Limiter::kNoCap, 0.02);
    widest = std::max(widest, rates.v * rates.w);
  }
  EXPECT_LE(widest, 0.6 * (1 + kTiny));
  EXPECT_GT(widest, 0.5);  // and no longer than it must
  EXPECT_EQ(limiter.rates().w, 1.2);
}

TEST(Limiter, ShapesACommand) {
  k::Limits limits = kRide;
  const auto expect = [&limits](k::Rates command, double cap, double v, double w) {
    const k::Rates result = k::shaped(limits, command, cap);
    EXPECT_NEAR(result.v, v, 1e-12);
    EXPECT_NEAR(result.w, w, 1e-12);
  };
  expect({9, 0.1}, 9, 1.5, 0.1);
  expect({-9, 0.1}, 9, -0.8, 0.1);
  expect({0.1, -9}, 9, 0.1, -1.2);
  expect({1.0, 1.2}, 9, 0.5, 1.2);  // |v w| = 0.6
  expect({1.0, 0.2}, 0.3, 0.3, 0.2);
  expect({1.0, 0.9}, 0.3, 0.3, 0.24);  // a fifth of v_forward: a fifth of w
  expect({1.0, 0.9}, 0, 0, 0);
  limits.keep_curvature = true;
  expect({3.0, 0.2}, 9, 1.5, 0.1);
  expect({0.1, -2.4}, 9, 0.05, -1.2);
  expect({1.2, 1.0}, 9, std::sqrt(0.72), std::sqrt(0.5));
  expect({0, 2.4}, 9, 0, 1.2);
  expect({1.0, 0.9}, 0, 0, 0);
}

TEST(Limiter, BrakingIsOverInSpeedOverDeceleration) {
  for (const bool keep : {false, true}) {
    k::Limits limits = kRide;
    limits.keep_curvature = keep;
    k::Limiter limiter(limits);
    for (int i = 0; i < 200; ++i) limiter.advance({0.9, 0.4}, k::Limiter::kNoCap, 0.02);
    double t = 0;
    for (; !limiter.rates().zero(); t += 0.02) {
      const k::Rates before = limiter.rates(), after = limiter.brake(0.02);
      ASSERT_LE(before.v - after.v, 1.2 * 0.02 * (1 + kTiny));
      ASSERT_LE(before.w - after.w, 2.5 * 0.02 * (1 + kTiny));
      if (keep && after.v > 0) {
        ASSERT_NEAR(after.w / after.v, 0.4 / 0.9, 1e-9);
      }
    }
    EXPECT_NEAR(t, 0.9 / 1.2, 0.0201);
  }
}

TEST(Limiter, ACommandWhileItBrakesGoesOnFromThere) {
  k::Limiter limiter(kRide);
  for (int i = 0; i < 200; ++i) limiter.advance({1.0, 0.0}, k::Limiter::kNoCap, 0.02);
  for (int i = 0; i < 10; ++i) limiter.brake(0.02);
  std::vector<Sample> samples{{0, limiter.rates().v}};
  for (int i = 0; i < 200; ++i) {
    samples.push_back({samples.back().t + 0.02, limiter.advance({-0.5, 0}, k::Limiter::kNoCap, 0.02).v});
  }
  expectBounded(samples, kRide.v_ramp);
  EXPECT_EQ(samples.back().rate, -0.5);
}

TEST(Limiter, ResetIsRestAtOnce) {
  k::Limiter limiter(kRide);
  limiter.advance({1.0, 0.3}, k::Limiter::kNoCap, 0.5);
  limiter.reset();
  EXPECT_TRUE(limiter.rates().zero());
  EXPECT_LT(limiter.advance({1.0, 0.3}, k::Limiter::kNoCap, 0.02).v, 0.5 * 3.0 * 0.02 * 0.02 * (1 + kTiny));
}

TEST(Limiter, LimitsLoweredOnTheWayAreComeToByRamps) {
  k::Limiter limiter(kRide);
  for (int i = 0; i < 200; ++i) limiter.advance({1.0, 0.6}, k::Limiter::kNoCap, 0.02);
  k::Limits slower = kRide;
  slower.v_forward = 0.4;
  slower.lateral_acceleration = 0.1;
  limiter.configure(slower);
  EXPECT_EQ(limiter.rates().v, 1.0);
  std::vector<Sample> v{{0, 1.0}}, w{{0, 0.6}};
  for (int i = 0; i < 300; ++i) {
    const k::Rates rates = limiter.advance({1.0, 0.6}, k::Limiter::kNoCap, 0.02);
    v.push_back({v.back().t + 0.02, rates.v});
    w.push_back({w.back().t + 0.02, rates.w});
  }
  expectBounded(v, slower.v_ramp);
  expectBounded(w, slower.w_ramp);
  EXPECT_NEAR(v.back().rate * w.back().rate, 0.1, 1e-9);
}

}  // namespace test_limiter
