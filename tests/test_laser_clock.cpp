// SPDX-License-Identifier: BSD-3-Clause
// Stamps by a sensor's clock against the truth of a made-up sensor and way.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "laser/clock.h"
#include "laser_clock_sim.h"

namespace test_laser_clock {

namespace l = kurumaisu::laser;
namespace sim = laser_clock_sim;

namespace {

constexpr double kEpoch = 1.7e9;       // [s] host's time at which sensors are switched on
constexpr double kDrift = 0.00125;     // [s/s] of the recorded URG-04LX
constexpr double kWrapped = 16774716;  // [ms] 2.5 s before the wrap
constexpr double kWrap = 16777.216;    // [s]

/// Follows a sensor, and checks what must hold of every stamp.
struct Follower {
  explicit Follower(const sim::Way& way, double drift = kDrift, double start = 0, unsigned seed = 1)
      : sensor(way, drift, start, kEpoch, seed) {}

  /// The error [s] of the next scan's stamp.
  double next() { return take(sensor.next()); }

  double take(const sim::Arrival& scan) {
    const double stamp = clock.stamp(scan.clock, scan.first_byte, sim::kLeastDelay);
    EXPECT_LE(stamp, scan.first_byte - sim::kLeastDelay + 1e-6) << "in the future";
    if (scan.first_byte >= last_host) {
      EXPECT_GE(stamp, last_stamp) << "goes backwards";
    }
    EXPECT_NEAR(clock.state().latency, scan.first_byte - sim::kLeastDelay - stamp, 1e-6);
    last_host = scan.first_byte;
    last_stamp = stamp;
    return stamp - scan.truth;
  }

  sim::Errors run(double seconds) {
    sim::Errors errors;
    for (int i = 0; i * sim::kScanTime < seconds; ++i) errors.add(next());
    return errors;
  }

  sim::Sensor sensor;
  l::DeviceClock clock{l::TimeMode::kEnvelope};
  double last_host = -std::numeric_limits<double>::infinity();
  double last_stamp = -std::numeric_limits<double>::infinity();
};

/// The most that a stamp may be off [s] once the rate is known: what the way's own fluctuations leave.
struct Bound {
  const char* name;
  sim::Way way;
  double start;   // in the first second the first scan may be late
  double learnt;  // from 20 s on
};

const Bound kBounds[] = {{"tcp", sim::kTcp, 0.003, 0.001},
                         {"usb", sim::kUsb, 0.010, 0.003},
                         {"polled", sim::kPolled, 0.020, 0.008},
                         {"busy", sim::kBusy, 0.205, 0.005}};

class Ways : public testing::TestWithParam<Bound> {};

}  // namespace

TEST_P(Ways, TellTheTimeWhateverTheDrift) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    const double drift = -0.002 + 0.0001 * seed;
    Follower follower(GetParam().way, drift, 0, seed);
    EXPECT_LT(follower.run(1).worst(), GetParam().start) << seed;
    EXPECT_LT(follower.run(4).worst(), 0.010) << seed;
    follower.run(15);
    EXPECT_LT(follower.run(100).worst(), GetParam().learnt) << seed;
    EXPECT_NEAR(follower.clock.state().drift, drift, 2e-4) << seed;
    EXPECT_EQ(follower.clock.state().resets, 0U) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(Laser, Ways, testing::ValuesIn(kBounds),
                         [](const testing::TestParamInfo<Bound>& bound) { return bound.param.name; });

TEST(DeviceClock, FirstStampIsTheArrivalLessTheLeastDelay) {
  l::DeviceClock clock(l::TimeMode::kEnvelope);
  EXPECT_DOUBLE_EQ(clock.stamp(1234, 1000.5, 0.07), 1000.43);
}

TEST(DeviceClock, CountsOnThroughTheWrap) {
  Follower follower(sim::kUsb, kDrift, kWrapped);
  EXPECT_LT(follower.run(60).worst(), 0.010);
  EXPECT_EQ(follower.clock.state().resets, 0U);
}

TEST(DeviceClock, IsAsGoodAfterADay) {
  Follower follower(sim::kUsb, kDrift, 0);
  follower.run(86400);
  const sim::Errors last = follower.run(60);
  EXPECT_LT(last.worst(), 0.003);
  EXPECT_LT(last.sd(), 0.0005);
  EXPECT_LE(follower.clock.state().span, 31);
  EXPECT_EQ(follower.clock.state().resets, 0U);
}

TEST(DeviceClock, RebootStartsAnewWithTheDriftKnown) {
  for (const double uptime : {5.0, 60.0, 3000.0}) {
    Follower follower(sim::kUsb);
    follower.run(uptime);
    follower.sensor.reboot(3);
    EXPECT_LT(follower.run(5).worst(), 0.015) << uptime;
    EXPECT_EQ(follower.clock.state().resets, 1U) << uptime;
    follower.run(20);
    EXPECT_LT(follower.run(60).worst(), 0.003) << uptime;
  }
}

TEST(DeviceClock, RebootBeforeTheLineIsKnownIsNoHarm) {
  Follower follower(sim::kUsb);
  follower.run(1);
  follower.sensor.reboot(0.3);
  EXPECT_LT(follower.run(5).worst(), 0.020);
}

TEST(DeviceClock, FollowsAHostsClockThatIsSet) {
  for (const double step : {3600.0, 10.0, 0.5, -0.03, -0.5, -10.0, -3600.0, 86400.0 * 365}) {
    Follower follower(sim::kUsb);
    follower.run(60);
    follower.sensor.stepHost(step);
    follower.run(3);
    EXPECT_LT(follower.run(10).worst(), 0.010) << step;
    // A step of more than a wrap looks as a silence does.
    EXPECT_EQ(follower.clock.state().resets, step < kWrap ? 1U : 0U) << step;
  }
}

TEST(DeviceClock, FollowsARateThatChanges) {
  for (const double change : {-5e-4, 5e-4}) {
    Follower follower(sim::kUsb);
    follower.run(60);
    follower.sensor.setDrift(kDrift + change);
    EXPECT_LT(follower.run(60).worst(), 0.012) << change;
    EXPECT_LT(follower.run(60).worst(), 0.003) << change;
    EXPECT_NEAR(follower.clock.state().drift, kDrift + change, 1e-4);
  }
}

TEST(DeviceClock, CountsWrapsThatNobodyHeard) {
  for (const double silence : {100.0, 0.9 * kWrap, 1.1 * kWrap, 3.4 * kWrap}) {
    Follower follower(sim::kUsb, kDrift, kWrapped);
    follower.run(60);
    follower.sensor.lose(static_cast<int>(silence / sim::kScanTime));
    EXPECT_LT(std::abs(follower.next()), 0.010) << silence;
    EXPECT_LT(follower.run(10).worst(), 0.010) << silence;
    EXPECT_EQ(follower.clock.state().resets, 0U) << silence;
  }
}

TEST(DeviceClock, KeepsTheSensorsTimeWhenScansComeInOneGo) {
  Follower follower(sim::kTcp);
  follower.run(60);
  std::vector<sim::Arrival> held;
  held.reserve(50);
  for (int i = 0; i < 50; ++i) held.push_back(follower.sensor.next());
  for (sim::Arrival& scan : held) {
    scan.first_byte = held.back().first_byte;
    EXPECT_LT(std::abs(follower.take(scan)), 0.002);
  }
  EXPECT_LT(follower.run(10).worst(), 0.002);
  EXPECT_EQ(follower.clock.state().resets, 0U);
}

TEST(DeviceClock, SeldomScansWillDo) {
  Follower follower(sim::kUsb);
  for (int i = 0; i < 30; ++i, follower.sensor.lose(9)) EXPECT_LT(std::abs(follower.next()), 0.010);
  for (int i = 0; i < 100; ++i, follower.sensor.lose(9)) EXPECT_LT(std::abs(follower.next()), 0.004);
}

TEST(DeviceClock, CalibrationFindsWhatEveryScanIsLateBy) {
  const sim::Way slow{0.001, 0.0005, 0, 0, 0};
  constexpr double kProcessing = 0.02;  // [s] in the sensor, of a scan but not of an answer
  for (unsigned seed = 0; seed < 20; ++seed) {
    Follower follower(slow, kDrift, kWrapped, seed);
    for (int i = 10; i > 0; --i) {
      const sim::Answer answer = follower.sensor.ask(0.5 + 0.02 * i);
      follower.clock.calibrate(answer.clock, answer.sent, answer.received);
    }
    for (int i = 0; i < 1000; ++i) {
      sim::Arrival scan = follower.sensor.next();
      scan.first_byte += kProcessing;
      const double error = follower.take(scan);
      if (i > 200) {
        ASSERT_LT(std::abs(error), 0.003) << seed;
      }
    }
    EXPECT_TRUE(follower.clock.state().calibrated);
    EXPECT_NEAR(follower.clock.state().send_delay, kProcessing + slow.least, 0.002);
  }
}

TEST(DeviceClock, AScanMayHaveBegunBeforeItsSensorToldTheTime) {
  l::DeviceClock clock(l::TimeMode::kEnvelope);
  constexpr double kSince = 1000;  // [s] host's time at which the sensor's clock was 0
  constexpr double kLeast = 0.07;
  constexpr double kSend = 0.027;
  clock.calibrate(490, kSince + 0.490, kSince + 0.490);
  for (std::uint32_t start = 450; start < 2000; start += 100) {
    EXPECT_NEAR(clock.stamp(start, kSince + 1e-3 * start + kLeast + kSend, kLeast), kSince + 1e-3 * start,
                1e-6);
  }
  EXPECT_TRUE(clock.state().calibrated);
  EXPECT_NEAR(clock.state().send_delay, kSend, 1e-6);
  EXPECT_EQ(clock.state().resets, 0U);
}

TEST(DeviceClock, CalibrationAfterARebootStartsAnew) {
  Follower follower(sim::kTcp);
  follower.run(60);
  follower.sensor.reboot(3);
  const sim::Answer answer = follower.sensor.ask(0.01);
  follower.clock.calibrate(answer.clock, answer.sent, answer.received);
  EXPECT_EQ(follower.clock.state().resets, 1U);
  EXPECT_LT(follower.run(10).worst(), 0.003);
  EXPECT_EQ(follower.clock.state().resets, 1U);
  EXPECT_TRUE(follower.clock.state().calibrated);
}

TEST(DeviceClock, RestartKeepsTheDriftAndTheSendDelay) {
  Follower follower(sim::kUsb);
  const sim::Answer answer = follower.sensor.ask(0.1);
  follower.clock.calibrate(answer.clock, answer.sent, answer.received);
  follower.run(60);
  const l::DeviceClock::State before = follower.clock.state();
  follower.clock.restart();
  EXPECT_LT(follower.run(3).worst(), 0.008);
  EXPECT_NEAR(follower.clock.state().drift, before.drift, 1e-4);
  EXPECT_EQ(follower.clock.state().send_delay, before.send_delay);
  EXPECT_EQ(follower.clock.state().resets, 0U);
}

TEST(DeviceClock, ResetForgetsTheDrift) {
  Follower follower(sim::kTcp);
  follower.run(60);
  EXPECT_GT(follower.clock.state().drift, 0.001);
  follower.clock.reset();
  EXPECT_EQ(follower.clock.state().drift, 0.0);
  EXPECT_EQ(follower.clock.state().span, 0.0);
}

TEST(DeviceClock, NonsenseNeverMakesAStampThatIsLateOrGoesBack) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int run = 0; run < 200; ++run) {
    Follower follower(sim::kUsb, kDrift, kWrapped, static_cast<unsigned>(run));
    for (int i = 0; i < 500; ++i) {
      sim::Arrival scan = follower.sensor.next();
      const double dice = uniform(random);
      if (dice < 0.02) scan.clock = static_cast<std::uint32_t>(random() & 0xffffff);
      if (dice > 0.99)
        follower.sensor.stepHost(std::pow(10, 8 * uniform(random) - 3) * (dice > 0.995 ? 1 : -1));
      if (dice > 0.98)
        follower.clock.calibrate(scan.clock, scan.first_byte - uniform(random), scan.first_byte);
      ASSERT_TRUE(std::isfinite(follower.take(scan)));
    }
  }
}

TEST(DeviceClock, NotAskedForIsTheArrival) {
  l::DeviceClock clock(l::TimeMode::kHost);
  sim::Sensor sensor(sim::kUsb, kDrift, kWrapped, kEpoch, 1);
  for (int i = 0; i < 100; ++i) {
    const sim::Arrival scan = sensor.next();
    ASSERT_EQ(clock.stamp(scan.clock, scan.first_byte, sim::kLeastDelay), scan.first_byte - sim::kLeastDelay);
  }
  EXPECT_NEAR(clock.state().drift, kDrift, 2e-4);
}

TEST(DeviceClockOfTheHost, IsTheMillisecondItself) {
  l::DeviceClock clock(l::TimeMode::kDevice);
  for (std::int64_t i = 0; i < 400000; i += 7) {
    const std::int64_t ms = std::int64_t{1700000000000} + 100 * i;
    const double truth = 1e-3 * static_cast<double>(ms);
    const double lag = 0.001 * static_cast<double>(i % 97);  // [s] simulated time is told in steps
    const double stamp = clock.stamp(static_cast<std::uint32_t>(ms & 0xffffff), truth + 0.07 - lag, 0.07);
    ASSERT_NEAR(stamp, truth, 1e-6) << i;
  }
  EXPECT_FALSE(clock.state().fallback);
}

TEST(DeviceClockOfTheHost, StartsAtNought) {
  l::DeviceClock clock(l::TimeMode::kDevice);
  EXPECT_DOUBLE_EQ(clock.stamp(0, 0.0, 0.07), 0.0);
  EXPECT_DOUBLE_EQ(clock.stamp(100, 0.17, 0.07), 0.1);
}

TEST(DeviceClockOfTheHost, FollowsSimulatedTimeThatStartsAgain) {
  l::DeviceClock clock(l::TimeMode::kDevice);
  EXPECT_DOUBLE_EQ(clock.stamp(50000, 50.07, 0.07), 50.0);
  EXPECT_DOUBLE_EQ(clock.stamp(100, 0.17, 0.07), 0.1);
}

TEST(DeviceClockOfTheHost, SaysWhenItIsNot) {
  l::DeviceClock clock(l::TimeMode::kDevice);
  sim::Sensor sensor(sim::kUsb, kDrift, 5000000, kEpoch, 1);
  for (int i = 0; i < 300; ++i) {
    const sim::Arrival scan = sensor.next();
    ASSERT_NEAR(clock.stamp(scan.clock, scan.first_byte, sim::kLeastDelay), scan.truth, 0.010);
    ASSERT_TRUE(clock.state().fallback);
  }
}

TEST(DeviceClockThatStands, GivesTheHostsTime) {
  for (const l::TimeMode mode : {l::TimeMode::kEnvelope, l::TimeMode::kDevice, l::TimeMode::kHost}) {
    l::DeviceClock clock(mode);
    for (int i = 0; i < 100; ++i) {
      ASSERT_NEAR(clock.stamp(50000, 50.07 + 0.1 * i, 0.07), 50.0 + 0.1 * i, 1e-9) << i;
      EXPECT_EQ(clock.state().stands, i > 0 && mode != l::TimeMode::kHost);
    }
    for (int i = 0; i < 100; ++i) {  // it goes on
      const auto ms = static_cast<std::uint32_t>(50100 + 100 * i);
      ASSERT_NEAR(clock.stamp(ms, 60.07 + 0.1 * i, 0.07), 60.0 + 0.1 * i, 0.01) << i;
      EXPECT_FALSE(clock.state().stands);
    }
  }
}

// The driver was stopped while simulated time ran on: it reads what was kept for it before it hears the time, then the
// time before the rest.
TEST(DeviceClockOfTheHost, IsTrustedWhileItsReaderWasHeldUp) {
  l::DeviceClock clock(l::TimeMode::kDevice);
  EXPECT_DOUBLE_EQ(clock.stamp(10000, 10.07, 0.07), 10.0);
  const double late[] = {10.07, 10.07, 16.07, 16.07, 16.08};  // [s] host's time
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(clock.stamp(static_cast<std::uint32_t>(10100 + 400 * i), late[i], 0.07), 10.1 + 0.4 * i,
                1e-9);
    EXPECT_FALSE(clock.state().fallback);
  }
  EXPECT_NEAR(clock.stamp(16100, 16.17, 0.07), 16.1, 1e-9);
}

TEST(DeviceClockOfTheHost, IsNotTrustedForLongOrAfterAPowerFailure) {
  l::DeviceClock late(l::TimeMode::kDevice);
  l::DeviceClock off(l::TimeMode::kDevice);
  late.stamp(10000, 10.07, 0.07);
  off.stamp(10000, 10.07, 0.07);
  for (int i = 1; i < 40; ++i) {
    late.stamp(static_cast<std::uint32_t>(10000 + 100 * i), 13.07 + 0.1 * i, 0.07);
    EXPECT_EQ(late.state().fallback, i > 21) << i;  // 2 s from the first
    off.stamp(static_cast<std::uint32_t>(100 * i), 11.07 + 0.1 * i, 0.07);
    EXPECT_TRUE(off.state().fallback);
  }
}

}  // namespace test_laser_clock
