// SPDX-License-Identifier: BSD-3-Clause
// The guard's state machine: what arms, what trips, and by random stories, that nothing else moves the chair.
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "guard/guard.h"
#include "guarding.h"
#include "sleep_watch.h"

namespace test_guard {

using namespace guarding;  // NOLINT: a test

namespace {

constexpr double kPeriod = 0.02;  // [s] of the client
constexpr double kStart = 1e6;    // [s] a machine that has run for twelve days

/// A client that behaves, unless a test makes it do otherwise.
class Story : public testing::Test {
 protected:
  Story() { guard.connect(); }

  void say(double translation, double steering = 0) { give(request(++sequence, now, translation, steering)); }

  void give(const g::Request& message) {
    watch.message(message, now);
    guard.receive(message, now);
    check();
  }

  void check() {
    const char* fault = watch.fault(guard, now);
    ASSERT_EQ(fault, nullptr) << fault;
  }

  /// Holds neutral until the guard arms, or for so long [s].
  double hold(double patience = 1.0) {
    const double begin = now;
    for (; guard.state() != g::State::kArmed && now - begin < patience; now += kPeriod) say(0);
    return now - kPeriod - begin;
  }

  void drive() {
    hold();
    say(0.4, 0.3);
    ASSERT_EQ(guard.output().translation, 0.4);
  }

  void expectTrip(g::Reason reason) {
    EXPECT_EQ(guard.state(), g::State::kTripped);
    EXPECT_EQ(guard.reason(), reason) << g::nameOf(guard.reason());
    EXPECT_EQ(guard.output().translation, 0);
    EXPECT_EQ(guard.output().steering, 0);
    EXPECT_EQ(guard.output().reference, 2.5);
  }

  g::Guard guard{limits()};
  Watch watch{limits()};
  double now = kStart;
  std::uint64_t sequence = 0;
};

TEST_F(Story, ArmsAfterHalfASecondOfNeutralAndNotBefore) {
  EXPECT_EQ(guard.state(), g::State::kIdle);
  EXPECT_NEAR(hold(), 0.5, kPeriod);
  EXPECT_EQ(guard.state(), g::State::kArmed);
  say(0.4, -0.3);
  EXPECT_EQ(guard.output().translation, 0.4);
  EXPECT_EQ(guard.output().steering, -0.3);
  EXPECT_EQ(guard.trips(), 0U);
}

TEST_F(Story, AStartWithACommandStaysNeutralUntilItIsReleased) {
  for (int i = 0; i < 100; ++i, now += kPeriod) {
    say(0.3);
    expectTrip(g::Reason::kNotNeutral);
  }
  EXPECT_EQ(guard.trips(), 1U);
  EXPECT_NEAR(hold(), 0.5, kPeriod);
  EXPECT_EQ(guard.state(), g::State::kArmed);
}

TEST_F(Story, HoldingBeginsAnewAfterACommand) {
  for (int i = 0; i < 20; ++i, now += kPeriod) say(0);
  say(0.1);
  expectTrip(g::Reason::kNotNeutral);
  now += kPeriod;
  EXPECT_NEAR(hold(), 0.5, kPeriod);
}

TEST_F(Story, TwoNeutralMessagesHalfASecondApartAreNotHeldNeutral) {
  say(0);
  now += 0.5;
  say(0);
  EXPECT_EQ(guard.state(), g::State::kHolding);
  now += 0.5;
  say(0);
  EXPECT_NE(guard.state(), g::State::kArmed);
}

TEST_F(Story, SilenceTripsJustAfterItsDeadline) {
  drive();
  const double deadline = guard.deadline().value();
  EXPECT_NEAR(deadline - now, 0.15, 1e-6);
  guard.advance(deadline);
  EXPECT_EQ(guard.state(), g::State::kArmed);
  guard.advance(std::nextafter(deadline, 1e9));
  expectTrip(g::Reason::kSilent);
  EXPECT_FALSE(guard.deadline());
}

TEST_F(Story, WhatTripsStaysNeutralUntilNeutralIsHeld) {
  drive();
  now += kPeriod;
  say(1.5);
  expectTrip(g::Reason::kStep);
  for (int i = 0; i < 100; ++i, now += kPeriod) say(0.4);
  expectTrip(g::Reason::kStep);  // the first reason remains
  EXPECT_EQ(guard.trips(), 1U);
  EXPECT_NEAR(hold(), 0.5, kPeriod);
  EXPECT_EQ(guard.reason(), g::Reason::kNone);
  say(0.4);
  EXPECT_EQ(guard.output().translation, 0.4);
}

struct Wrong {
  const char* name;
  g::Reason reason;
  void (*spoil)(g::Request& message);
};

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t kMillisecond = 1'000'000;  // [ns]

const std::vector<Wrong> kWrongs = {
    {"Same sequence", g::Reason::kSequence, [](g::Request& m) { --m.sequence; }},
    {"Sequence 0", g::Reason::kSequence, [](g::Request& m) { m.sequence = 0; }},
    {"Old", g::Reason::kOld, [](g::Request& m) { m.time -= 101 * kMillisecond; }},
    {"Before the last one", g::Reason::kOld, [](g::Request& m) { m.time -= 21 * kMillisecond; }},
    {"Very old", g::Reason::kOld, [](g::Request& m) { m.time = std::numeric_limits<std::int64_t>::min(); }},
    {"Of the system's clock", g::Reason::kFuture, [](g::Request& m) { m.time = 1'800'000'000'000'000'000; }},
    {"From just now on", g::Reason::kFuture, [](g::Request& m) { m.time += kMillisecond; }},
    {"NaN", g::Reason::kNotFinite, [](g::Request& m) { m.translation = kNaN; }},
    {"Steering NaN", g::Reason::kNotFinite, [](g::Request& m) { m.steering = kNaN; }},
    {"Infinite", g::Reason::kNotFinite, [](g::Request& m) { m.steering = -kInfinity; }},
    {"Reference NaN", g::Reason::kNotFinite, [](g::Request& m) { m.reference = kNaN; }},
    {"Above the band", g::Reason::kBand, [](g::Request& m) { m.translation = 2.001; }},
    {"Below the band", g::Reason::kBand, [](g::Request& m) { m.steering = -1e300; }},
    {"Another reference", g::Reason::kReference, [](g::Request& m) { m.reference = 2.511; }},
    {"Step up", g::Reason::kStep, [](g::Request& m) { m.translation = 0.901; }},
    {"Step across neutral", g::Reason::kStep, [](g::Request& m) { m.steering = -0.101; }},
    {"Unknown kind", g::Reason::kGarbage, [](g::Request& m) { m.kind = 3; }},
    {"Another version", g::Reason::kVersion, [](g::Request& m) { m.version = 2; }},
    {"Stop", g::Reason::kStopped, [](g::Request& m) { m.kind = 2; }},
};

TEST_F(Story, EveryWrongMessageTripsAtOnceAndItsRightTwinDoesNot) {
  for (const Wrong& wrong : kWrongs) {
    SCOPED_TRACE(wrong.name);
    guard = g::Guard(limits());
    guard.connect();
    watch.broken();
    drive();
    now += kPeriod;
    say(0.4, 0.3);
    EXPECT_EQ(guard.state(), g::State::kArmed);
    now += kPeriod;
    g::Request message = request(++sequence, now, 0.4, 0.3);
    wrong.spoil(message);
    give(message);
    expectTrip(wrong.reason);
    EXPECT_EQ(guard.trips(), 1U);
  }
}

TEST_F(Story, TowardsNeutralIsFreeHoweverFar) {
  drive();
  for (double volts = 0.4; volts < 2.0; volts += 0.4, now += kPeriod) say(volts);
  say(0, 0);
  EXPECT_EQ(guard.state(), g::State::kArmed);
  EXPECT_EQ(guard.output().translation, 0);
}

TEST_F(Story, StepsThatComeFasterThanTheirRateTrip) {
  drive();
  now += kPeriod;
  say(0.8, 0.3);
  EXPECT_EQ(guard.state(), g::State::kArmed);
  now += 0.001;  // of the step of 0.5 V, 0.1 V is left, and 0.02 V is there again
  say(0.91, 0.3);
  EXPECT_EQ(guard.state(), g::State::kArmed);
  now += 0.001;
  say(1.0, 0.3);
  expectTrip(g::Reason::kStep);
}

TEST_F(Story, BackAndForthCountsEachTimeItLeavesNeutral) {
  drive();
  now += 0.1;
  say(0.4, -0.05);  // across neutral: 0.35 V
  now += 0.001;
  say(0.4, 0);
  say(0.4, 0.1);
  expectTrip(g::Reason::kStep);
}

TEST_F(Story, WithoutASentinelItIsNeutralAndDoesNotArm) {
  drive();
  guard.watch(false);
  expectTrip(g::Reason::kUnwatched);
  hold();
  expectTrip(g::Reason::kUnwatched);
  guard.watch(true);
  now += kPeriod;
  say(0.4);
  expectTrip(g::Reason::kUnwatched);
  watch.broken();
  EXPECT_NEAR(hold(), 0.5, kPeriod);
}

TEST_F(Story, WhatWasAskedForBeforeASleepDoesNotCount) {
  drive();
  guard.wake();
  expectTrip(g::Reason::kSlept);
  EXPECT_NEAR(hold(), 0.5, kPeriod);
}

TEST(SleepWatch, NoticesASleepOnce) {
  std::int64_t slept = 7'000'000'000;
  kurumaisu::SleepWatch watch([&slept] { return slept; });
  slept += 1'000;  // clocks that were not read at one time
  EXPECT_FALSE(watch.hasSlept());
  slept += 3'600'000'000'000;
  EXPECT_TRUE(watch.hasSlept());
  EXPECT_FALSE(watch.hasSlept());
}

TEST_F(Story, ANewClientMustHoldNeutralToo) {
  drive();
  guard.disconnect();
  expectTrip(g::Reason::kClientGone);
  guard.connect();
  sequence = 0;  // its numbers are its own
  now += 1.0;
  say(0.4);
  expectTrip(g::Reason::kClientGone);
  EXPECT_NEAR(hold(), 0.5, kPeriod);
}

TEST_F(Story, AClientThatLeavesBeforeArmingTripsNothing) {
  say(0);
  guard.disconnect();
  EXPECT_EQ(guard.state(), g::State::kIdle);
  EXPECT_EQ(guard.trips(), 0U);
}

TEST_F(Story, AFaultOfTheDeviceLatchesAndNothingArmsWhileItIsLost) {
  drive();
  guard.loseDevice();
  expectTrip(g::Reason::kDevice);
  hold();
  expectTrip(g::Reason::kDevice);
  guard.findDevice();
  now += kPeriod;
  say(0.4);
  expectTrip(g::Reason::kDevice);
  watch.broken();
  EXPECT_NEAR(hold(), 0.5, kPeriod);
}

TEST_F(Story, AlmostNeutralArmsButNeutralIsPutOut) {
  for (; now < kStart + 0.4; now += kPeriod) say(0.003, -0.003);
  EXPECT_EQ(guard.state(), g::State::kHolding);
  EXPECT_EQ(guard.output().translation, 0);
  EXPECT_EQ(guard.output().steering, 0);
}

TEST(GuardLimits, ThatMakeNoSenseAreRefused) {
  const std::vector<void (*)(g::Limits&)> spoils = {
      [](g::Limits& l) { l.translation.low = 0.1; },
      [](g::Limits& l) { l.steering.high = 0; },
      [](g::Limits& l) { l.steering.step = 0; },
      [](g::Limits& l) { l.translation.rate = 0; },
      [](g::Limits& l) { l.neutral = 1.5; },
      [](g::Limits& l) { l.neutral = -0.1; },
      [](g::Limits& l) { l.reference = kNaN; },
      [](g::Limits& l) { l.reference_tolerance = -1; },
      [](g::Limits& l) { l.age = 0.2; },
      [](g::Limits& l) { l.age = 0; },
      [](g::Limits& l) { l.silence = 0.5; },
      [](g::Limits& l) { l.translation.high = kNaN; },
  };
  for (std::size_t i = 0; i < spoils.size(); ++i) {
    g::Limits bad = limits();
    spoils[i](bad);
    EXPECT_THROW(g::Guard{bad}, std::invalid_argument) << i;
  }
}

/// A random story: mostly good messages, so that the guard arms, and every kind of trouble.
class RandomStory {
 public:
  explicit RandomStory(unsigned seed) : dice_(seed) { guard_.connect(); }

  /// Tells it. Returns how often the guard moved the chair.
  int tell(int length) {
    int moves = 0;
    for (int i = 0; i < length; ++i) {
      step();
      const char* fault = watch_.fault(guard_, now_);
      if (fault != nullptr) {
        ADD_FAILURE() << "step " << i << ": " << fault;
        return moves;
      }
      moves += guard_.output().translation != 0;
    }
    return moves;
  }

 private:
  double roll(double low, double high) { return std::uniform_real_distribution<>(low, high)(dice_); }
  bool chance(double probability) { return roll(0, 1) < probability; }

  void step() {
    now_ += chance(0.005) ? roll(0, 0.4) : roll(0.005, 0.03);
    if (chance(0.002)) {
      guard_.disconnect();
      guard_.connect();
      watch_.broken();
    }
    if (chance(0.002)) {
      guard_.loseDevice();
      watch_.device(true);
    }
    if (chance(0.002)) guard_.wake();
    if (chance(0.002)) guard_.watch(false);
    if (chance(0.1)) guard_.watch(true);
    if (chance(0.05)) {
      guard_.findDevice();
      watch_.device(false);
    }
    if (chance(0.002)) {
      guard_.receiveGarbage();
      watch_.broken();
    }
    guard_.advance(now_);
    if (chance(0.98)) give();
  }

  void give() {
    if (chance(0.01)) holding_ = !holding_;
    translation_ = holding_ ? 0 : std::clamp(translation_ + roll(-0.3, 0.3), -2.05, 2.05);
    g::Request message =
        request(++sequence_, now_ - roll(0, 0.0009), translation_, holding_ ? 0 : roll(-0.2, 0.2));
    if (chance(0.01))
      kWrongs[static_cast<std::size_t>(roll(0, static_cast<double>(kWrongs.size()) - 1e-9))].spoil(message);
    watch_.message(message, now_);
    guard_.receive(message, now_);
  }

  std::mt19937 dice_;
  g::Guard guard_{limits()};
  Watch watch_{limits()};
  double now_ = kStart;
  double translation_ = 0;
  bool holding_ = true;
  std::uint64_t sequence_ = 0;
};

TEST(GuardRandom, ArmedAndMovingOnlyAfterNeutralAndByRecentMessages) {
  int moves = 0;
  for (unsigned seed = 1; seed <= 50; ++seed) moves += RandomStory(seed).tell(6000);
  EXPECT_GT(moves, 10'000);  // else the stories say nothing
}

}  // namespace

}  // namespace test_guard
