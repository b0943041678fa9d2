// SPDX-License-Identifier: BSD-3-Clause
// Who drives: priorities, timeouts, locks, several publishers, release; the emergency stop; the cap.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <thread>

#include "base/last_word.h"
#include "base/report.h"
#include "base_drive.h"

namespace test_arbiter {

namespace k = kurumaisu;
using namespace kurumaisu::test;  // NOLINT(google-build-using-namespace)

namespace {

const k::Speaker kA{"/a"};
const k::Speaker kB{"/b"};

k::ArbiterSettings withDeadMan() {
  k::ArbiterSettings settings = kArbiter;
  settings.locks.push_back({"dead man", 150, 0.3, false});
  return settings;
}

class ArbiterTest : public testing::Test {
 protected:
  ArbiterTest() { arbiter.choose(0); }

  k::Choice hear(Input input, double v, double t, const std::string& publisher = "/a") {
    arbiter.command(input, publisher, {v, 0}, t);
    return arbiter.choose(t);
  }

  k::Arbiter arbiter{kArbiter};
};

}  // namespace

TEST_F(ArbiterTest, TheHighestPriorityThatSpeaksDrives) {
  EXPECT_EQ(hear(kShared, 0.1, 1.0).command.v, 0.1);
  EXPECT_EQ(hear(kJoystick, 0.2, 1.1).command.v, 0.2);
  EXPECT_EQ(hear(kNavigation, 0.3, 1.2).command.v, 0.2);
  EXPECT_EQ(*arbiter.choose(1.34).input, kJoystick);
  EXPECT_EQ(arbiter.choose(1.36).command.v, 0.3);  // the joystick has been silent for 0.25 s
  EXPECT_EQ(arbiter.choose(1.46).reason, k::Reason::kIdle);
  EXPECT_EQ(arbiter.counts().timeouts, 2U);
}

TEST_F(ArbiterTest, AZeroOfTheHighestHoldsTheOthersOff) {
  hear(kNavigation, 0.3, 1.0);
  EXPECT_EQ(hear(kJoystick, 0.0, 1.1).command.v, 0.0);
  EXPECT_EQ(*arbiter.last().input, kJoystick);
}

TEST_F(ArbiterTest, ALockBlocksWhatIsBelowItsPriority) {
  hear(kNavigation, 0.3, 1.0);
  arbiter.lock(kHold, kA, true, 1.0);
  const k::Choice choice = arbiter.choose(1.1);
  EXPECT_EQ(choice.reason, k::Reason::kLocked);
  EXPECT_EQ(*choice.lock, kHold);
  EXPECT_EQ(hear(kJoystick, 0.2, 1.1).reason, k::Reason::kDriving);
  arbiter.lock(kHold, kA, false, 1.2);
  EXPECT_EQ(hear(kNavigation, 0.3, 9.0).reason, k::Reason::kDriving);  // its silence means nothing
}

TEST(Arbiter, ADeadManThatFallsSilentOrWasNeverHeardBlocks) {
  k::Arbiter arbiter(withDeadMan());
  arbiter.choose(0);
  const auto reason = [&arbiter](double t) {
    arbiter.command(kNavigation, "/a", {0.3, 0}, t);
    return arbiter.choose(t).reason;
  };
  EXPECT_EQ(reason(1.0), k::Reason::kLocked);
  arbiter.lock(kDeadMan, kA, false, 1.1);  // held
  EXPECT_EQ(reason(1.1), k::Reason::kDriving);
  EXPECT_EQ(reason(1.39), k::Reason::kDriving);
  EXPECT_EQ(reason(1.41), k::Reason::kLocked);
  arbiter.lock(kDeadMan, kA, false, 1.5);
  EXPECT_EQ(reason(1.5), k::Reason::kDriving);
  arbiter.lock(kDeadMan, kA, true, 1.6);  // let go
  EXPECT_EQ(reason(1.6), k::Reason::kLocked);
  arbiter.lock(kDeadMan, kA, false, 1.7);
  EXPECT_EQ(reason(1.7), k::Reason::kDriving);
  EXPECT_EQ(reason(0.5), k::Reason::kIdle);  // the clock was set back: nobody knows how old a word is
  EXPECT_EQ(reason(0.6), k::Reason::kLocked);
}

TEST_F(ArbiterTest, ALockHoldsAsLongAsAnyOfItsPublishersHoldsIt) {
  const auto reason = [this](double t) { return hear(kNavigation, 0.3, t).reason; };
  arbiter.lock(kHold, kA, true, 1.0);
  arbiter.lock(kHold, kB, false, 1.0);
  EXPECT_EQ(reason(1.0), k::Reason::kLocked);
  arbiter.lock(kHold, kA, false, 1.1);
  EXPECT_EQ(reason(1.1), k::Reason::kDriving);
}

TEST_F(ArbiterTest, AWordOfOneWhoIsGoneStandsUntilAnybodySpeaksOrTheLocksAreReset) {
  const auto reason = [this](double t) { return hear(kNavigation, 0.3, t).reason; };
  bool is_there = true;
  const k::Speaker leaving{"/leaving", [&is_there] { return is_there; }};
  arbiter.lock(kHold, leaving, true, 1.0);
  is_there = false;
  EXPECT_EQ(reason(1.0), k::Reason::kLocked);
  arbiter.lock(kHold, kA, false, 1.1);
  EXPECT_EQ(reason(1.1), k::Reason::kDriving);
  is_there = true;
  arbiter.lock(kHold, leaving, true, 1.2);
  arbiter.forgetGone();
  EXPECT_EQ(reason(1.2), k::Reason::kLocked);
  is_there = false;
  arbiter.forgetGone();
  EXPECT_EQ(reason(1.3), k::Reason::kDriving);
}

TEST(Arbiter, ADeadManThatNeedNotBeThereBlocksOnceItWasHeard) {
  k::ArbiterSettings settings = withDeadMan();
  settings.locks[kDeadMan].from_start = false;
  k::Arbiter arbiter(settings);
  arbiter.choose(0);
  const auto reason = [&arbiter](double t) {
    arbiter.command(kNavigation, "/a", {0.3, 0}, t);
    return arbiter.choose(t).reason;
  };
  EXPECT_EQ(reason(1.0), k::Reason::kDriving);
  EXPECT_EQ(k::deadMenUnheard(arbiter), std::vector<std::string>{"dead man"});
  arbiter.lock(kDeadMan, kA, false, 1.1);  // held
  EXPECT_EQ(reason(1.1), k::Reason::kDriving);
  EXPECT_EQ(k::deadMenUnheard(arbiter), std::vector<std::string>{});
  EXPECT_EQ(reason(1.41), k::Reason::kLocked);
  arbiter.lock(kDeadMan, kA, false, 1.5);
  arbiter.lock(kDeadMan, kB, true, 1.5);
  EXPECT_EQ(reason(1.5), k::Reason::kLocked);
}

TEST_F(ArbiterTest, ARateThatTheChairCannotGoIsRest) {
  k::ArbiterSettings settings = kArbiter;
  settings.rest = {0.001, 0.002};
  k::Arbiter slow(settings);
  slow.choose(0);
  slow.command(kNavigation, "/a", {1e-300, 0}, 1.0);
  EXPECT_TRUE(slow.choose(1.0).command.zero());
  slow.command(kNavigation, "/a", {0.001, -0.0019}, 1.1);
  EXPECT_EQ(slow.choose(1.1).command.v, 0.001);
  EXPECT_EQ(slow.choose(1.1).command.w, 0);
}

TEST_F(ArbiterTest, TwoPublishersStopAnInputUnlessItAllowsSeveral) {
  hear(kNavigation, 0.3, 1.0, "/a");
  EXPECT_EQ(hear(kNavigation, 0.0, 1.1, "/b").reason, k::Reason::kSeveral);
  EXPECT_EQ(arbiter.publishers(kNavigation), (std::vector<std::string>{"/a", "/b"}));
  EXPECT_EQ(hear(kJoystick, 0.2, 1.1).reason, k::Reason::kDriving);  // who stands above it is free
  hear(kNavigation, 0.3, 1.36, "/b");
  EXPECT_EQ(arbiter.choose(1.37).command.v, 0.3);  // /a is gone
  hear(kShared, 0.3, 3.0, "/a");
  EXPECT_EQ(hear(kShared, 0.1, 3.1, "/b").command.v, 0.1);
  EXPECT_EQ(arbiter.counts().conflicts, 1U);
}

TEST_F(ArbiterTest, AfterDisarmingEveryInputMustBeReleasedAnew) {
  EXPECT_EQ(hear(kNavigation, 0.3, 1.0).reason, k::Reason::kDriving);
  arbiter.disarm();
  EXPECT_EQ(hear(kNavigation, 0.3, 1.1).reason, k::Reason::kUnreleased);
  EXPECT_TRUE(arbiter.moving(1.1));
  EXPECT_FALSE(arbiter.moving(1.4));
  EXPECT_EQ(hear(kNavigation, 0.3, 1.4).reason, k::Reason::kDriving);  // it was silent
}

// Fault 11
TEST(Arbiter, WhereTheFirstWordMustBeRestSilenceBeforeItReleasesNothing) {
  k::ArbiterSettings settings = kArbiter;
  settings.first_word_is_rest = true;
  k::Arbiter arbiter(settings);
  arbiter.choose(0);
  const auto reason = [&arbiter](double v, double t) {
    arbiter.command(kNavigation, "/a", {v, 0}, t);
    return arbiter.choose(t).reason;
  };
  EXPECT_EQ(reason(0.3, 5.0), k::Reason::kUnreleased);
  EXPECT_EQ(reason(0.3, 5.2), k::Reason::kUnreleased);
  EXPECT_EQ(reason(0.3, 5.5), k::Reason::kDriving);  // let go: it was silent since it was heard
  arbiter.reset();
  arbiter.choose(6.0);
  EXPECT_EQ(reason(0.3, 7.0), k::Reason::kUnreleased);
  EXPECT_EQ(reason(0.0, 7.1), k::Reason::kDriving);
}

TEST(EStop, IsReleasedByNothingButAReset) {
  k::EStop stop(0);
  stop.tick(1);
  EXPECT_FALSE(stop.stopped());
  stop.hear(kA, true, 2);
  stop.hear(kA, false, 3);
  stop.tick(4);
  EXPECT_TRUE(stop.latched());
  EXPECT_EQ(stop.reset(true), "motion is commanded: release the input first");
  EXPECT_EQ(stop.reset(false), "");
  stop.tick(1000);
  EXPECT_FALSE(stop.stopped());  // without a timeout silence means nothing
  stop.press();
  EXPECT_TRUE(stop.latched());
  stop.hear(kA, true, 1001);
  EXPECT_EQ(stop.reset(false), "the emergency stop is still pressed by /a");
}

TEST(EStop, WithATimeoutSomebodyMustSayThatAllIsWell) {
  k::EStop stop(0.3);
  stop.tick(1.0);
  EXPECT_TRUE(stop.stopped());
  EXPECT_FALSE(stop.latched());
  stop.hear(kA, false, 1.2);
  stop.tick(1.4);
  EXPECT_FALSE(stop.stopped());
  stop.tick(1.51);
  EXPECT_TRUE(stop.latched());
  EXPECT_EQ(stop.reset(false), "no message says that the emergency stop is not pressed");
  stop.hear(kA, false, 1.6);
  stop.tick(1.6);
  EXPECT_EQ(stop.reset(false), "");
  stop.tick(0.1);  // the clock was set back
  EXPECT_TRUE(stop.stopped());
  EXPECT_FALSE(stop.latched());
  stop.tick(0.41);
  EXPECT_TRUE(stop.latched());
}

TEST(EStop, HoldsAsLongAsAnybodyPressesIt) {
  k::EStop stop(0);
  bool is_there = true;
  const k::Speaker leaving{"/leaving", [&is_there] { return is_there; }};
  stop.hear(kA, true, 1);
  stop.hear(kB, false, 2);
  stop.hear(leaving, true, 2);
  EXPECT_EQ(stop.reset(false), "the emergency stop is still pressed by /a, /leaving");
  stop.hear(kA, false, 3);
  EXPECT_EQ(stop.reset(false), "the emergency stop is still pressed by /leaving");
  is_there = false;  // its press stays; but nobody is left to take it back
  EXPECT_TRUE(stop.latched());
  EXPECT_EQ(stop.reset(false), "");
}

TEST(EStop, WithATimeoutNobodyWhoWatchesMayFallSilent) {
  k::EStop stop(0.3);
  stop.tick(1.0);
  stop.hear(kA, false, 1.1);
  stop.hear(kB, false, 1.1);
  stop.hear(kB, false, 1.3);
  stop.tick(1.3);
  EXPECT_FALSE(stop.stopped());
  stop.hear(kB, false, 1.41);
  stop.tick(1.41);
  EXPECT_TRUE(stop.latched());
}

TEST(SpeedCap, OfSeveralTheLowestCountsAndNonsenseStops) {
  k::SpeedCap cap({0.5, 1.2});
  cap.hear("/a", 0.4, 1.0);
  cap.hear("/b", 0.9, 1.1);
  EXPECT_EQ(cap.at(1.2), 0.4);
  EXPECT_EQ(cap.at(1.55), 0.9);
  for (const double nonsense : {-1.0, -HUGE_VAL, std::nan("")}) {
    EXPECT_FALSE(cap.hear("/a", nonsense, 2.0));
    EXPECT_EQ(cap.at(2.0), 0);
  }
  EXPECT_EQ(cap.at(2.51), 1.2);
  EXPECT_EQ(cap.counts().refused, 3U);
}

TEST(SpeedCap, HoldsForItsTimeout) {
  k::SpeedCap cap({0.5, 1.2});
  EXPECT_EQ(cap.at(0), 1.2);
  EXPECT_TRUE(cap.hear("/a", 0.0, 1.0));
  EXPECT_EQ(cap.at(1.5), 0.0);
  EXPECT_EQ(cap.at(1.51), 1.2);
  cap.hear("/a", 0.2, 9.0);
  EXPECT_EQ(cap.at(3.0), 1.2);  // the clock was set back
}

TEST(LastWordDeathTest, ATerminateSaysItAndAborts) {
  EXPECT_DEATH(
      {
        const k::LastWord word([] { std::fputs("neutral\n", stderr); });
        std::terminate();
      },
      "neutral");
  EXPECT_DEATH(  // an exception that nobody catches, in another thread; the word fails, too
      {
        const k::LastWord word([] {
          std::fputs("neutral\n", stderr);
          throw std::runtime_error("no converter");
        });
        std::thread([] { throw std::runtime_error("lost"); }).join();
      },
      "neutral");
}

}  // namespace test_arbiter
