// SPDX-License-Identifier: BSD-3-Clause
// The driver against a virtual sensor without faults: what it measures, its settings, its port.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "laser_watched.h"

namespace test_laser_driver {

using namespace watching;  // NOLINT: a test

TEST(Driver, AddsLittleLatency) {
  constexpr std::size_t kScans = 40;
  Sensor sensor({{}, true, "utm_30lx"});
  Watched watched(sensor.settings());
  std::vector<double> latencies;
  for (std::uint64_t scan = 1; scan <= kScans; ++scan) {
    ASSERT_TRUE(watched.awaitStatus([=](const l::Status& s) { return s.counts.scans >= scan; }, kLong));
    latencies.push_back(watched.driver().status().latency);
  }
  std::sort(latencies.begin(), latencies.end());
  EXPECT_LT(latencies[kScans / 2], 1e-3);
  EXPECT_LT(watched.stop().cpu, 0.08);  // 40 scans of 1081 beams a second
}

TEST(Driver, PublishesCodesAsNoMeasurement) {
  for (const auto& [name, result] : runAll({{"zeros", {{"zeros"}, false, "urg_04lx_ug01", 2}},
                                            {"codes", {{"codes"}, false, "urg_04lx_ug01", 2}}})) {
    ASSERT_GE(result.scans.size(), 2U) << name;
    for (const float range : result.scans[1].scan.ranges) {
      EXPECT_TRUE(std::isnan(range) || std::isinf(range)) << name << " " << range;
    }
  }
}

TEST(Driver, SendsIntensitiesWhereThereAreAny) {
  const auto wanted = [](l::DriverSettings& settings) { settings.live.intensity = true; };
  const auto results = runAll({{"has", {{}, false, "utm_30lx", 5, kLong, wanted}},
                               {"has none", {{"no-me"}, false, "utm_30lx", 5, kLong, wanted}}});
  const Result& has = results.at("has");
  ASSERT_GE(has.scans.size(), 5U) << has.status.last_error;
  EXPECT_TRUE(has.status.intensity);
  for (const Came& came : has.scans) {
    expectRoom(came.scan);
    ASSERT_EQ(came.scan.intensities.size(), came.scan.ranges.size());
    for (std::size_t i = 0; i < came.scan.intensities.size(); ++i) {
      ASSERT_EQ(came.scan.intensities[i], 100.0F + static_cast<float>(i));
    }
  }
  const Result& none = results.at("has none");
  ASSERT_GE(none.scans.size(), 5U) << none.status.last_error;
  EXPECT_FALSE(none.status.intensity);
  EXPECT_TRUE(none.scans.back().scan.intensities.empty());
  EXPECT_TRUE(none.tells("LASER_NO_INTENSITY: ME"));
}

TEST(Driver, ChangesTheWindowLive) {
  Sensor sensor({{}, false, "utm_30lx"});
  Watched watched(sensor.settings());
  ASSERT_TRUE(watched.await(3, kLong));
  EXPECT_THROW(watched.driver().reconfigure({2.5, 2.6, 1, 0, false}), std::invalid_argument);
  EXPECT_THROW(watched.driver().reconfigure({0.5, 0.1, 1, 0, false}), std::invalid_argument);
  watched.driver().reconfigure({-0.5, 1.0, 3, 1, false});
  const double period = 0.05;
  EXPECT_TRUE(watched.awaitStatus(
      [&](const l::Status& status) { return std::abs(status.scan_period - period) < 1e-9; }, 1));
  const std::uint64_t before = watched.driver().status().counts.scans;
  ASSERT_TRUE(watched.await(before + 4, kLong));
  const Result result = watched.stop();
  const l::Scan& last = result.scans.back().scan;
  EXPECT_NEAR(last.angle_increment, 3 * 2 * M_PI / 1440, 1e-9);
  EXPECT_GE(last.angle_min, -0.5);
  EXPECT_LE(last.angle_max, 1.0);
  EXPECT_NEAR(last.scan_time, period, 1e-9);
  EXPECT_EQ(result.status.counts.reconnects, 0U);
  EXPECT_EQ(result.status.counts.lost, 0U);
  EXPECT_LT(result.longestGap(), kRecovery);
}

TEST(Driver, BeginsAnewWhenTold) {
  Sensor sensor({{}, true, "utm_30lx"});
  Watched watched(sensor.settings());
  ASSERT_TRUE(watched.await(2, kLong));
  watched.driver().restart();
  EXPECT_TRUE(watched.awaitStatus([](const l::Status& status) { return status.counts.reconnects == 1; }, 1));
  const std::uint64_t before = watched.driver().status().counts.scans;
  EXPECT_TRUE(watched.await(before + 2, kLong));
}

TEST(Driver, LeavesAPortToItsOwner) {
  Sensor sensor({{}, true, "utm_30lx"});
  auto first = std::make_unique<Watched>(sensor.settings());
  ASSERT_TRUE(first->await(2, kLong));
  Watched second(sensor.settings());
  EXPECT_TRUE(second.awaitStatus(
      [](const l::Status& status) { return status.last_error.find("LASER_IN_USE") == 0; }, kLong));
  const std::uint64_t before = first->driver().status().counts.scans;
  EXPECT_TRUE(first->await(before + 5, kLong));
  EXPECT_EQ(first->driver().status().counts.lost, 0U);
  EXPECT_EQ(second.driver().status().counts.scans, 0U);
  first.reset();
  EXPECT_TRUE(second.await(2, kLong));
}

TEST(Driver, AsksTheClockWhenTold) {
  const auto result = run(
      {{}, false, "utm_30lx", 3, kLong, [](l::DriverSettings& settings) { settings.calibrate_time = true; }});
  ASSERT_GE(result.scans.size(), 3U) << result.status.last_error;
  EXPECT_TRUE(result.status.clock.calibrated);
  EXPECT_FALSE(result.tells("LASER_NO_CALIBRATION"));
}

/// The simulator has been paused: the sensor's time stands, and so does the host's.
TEST(Driver, WaitsWhileTimeStands) {
  Sensor sensor({{"stall@3"}});
  std::atomic<bool> stands{true};
  std::atomic<std::uint64_t> scans{0};
  l::Driver driver(
      sensor.settings(), [&](const l::Scan&) { ++scans; },
      [&] { return stands ? 100.0 : kurumaisu::steadyTime(); }, [](const l::Report&) {});
  driver.start();
  const auto await = [&](std::uint64_t count, double seconds) {
    const double until = kurumaisu::steadyTime() + seconds;
    while (scans < count && kurumaisu::steadyTime() < until)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return scans >= count;
  };
  ASSERT_TRUE(await(2, kLong));
  EXPECT_FALSE(await(4, 1.0));  // longer than it takes for a sensor to be stale
  EXPECT_EQ(driver.status().counts.reconnects, 0U);
  stands = false;
  EXPECT_TRUE(await(4, kLong));
}

TEST(Driver, RefusesSettingsThatCannotBe) {
  const Sensor sensor({{}, false, "utm_30lx"});
  const auto problem = [&](const std::function<void(l::DriverSettings&)>& change) -> std::string {
    l::DriverSettings settings = sensor.settings();
    change(settings);
    try {
      l::Driver(
          settings, [](const l::Scan&) {}, kurumaisu::steadyTime, [](const l::Report&) {});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(problem([](auto&) {}), "nothing");
  EXPECT_EQ(problem([](auto& s) { s.serial_port = "/dev/ttyACM0"; }).find("either serial_port or ip_address"),
            0U);
  EXPECT_EQ(problem([](auto& s) { s.ip_address.clear(); }).find("either serial_port or ip_address"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.ip_port = 0; }).find("ip_port"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.stale_timeout = 0; }).find("stale_timeout"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.retry_max = 0; }).find("retry_max"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.live.cluster = 0; }).find("cluster"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.live.skip = 10; }).find("skip"), 0U);
  EXPECT_EQ(problem([](auto& s) {
              s.ip_address.clear();
              s.serial_port = "/dev/ttyACM0";
              s.serial_baud = 9600;
            }).find("serial_baud"),
            0U);
}

/// The window of one sensor may lie outside what another sees.
TEST(Driver, WaitsForSettingsThatFitTheSensor) {
  Sensor sensor({{}, false, "utm_30lx"});
  l::DriverSettings settings = sensor.settings();
  settings.live.angle_min = 3.0;
  Watched watched(settings);
  ASSERT_TRUE(watched.awaitStatus(
      [](const l::Status& status) { return status.state == l::State::kMisconfigured; }, kLong));
  EXPECT_EQ(watched.driver().status().last_error.find("LASER_SETTINGS: angle_min"), 0U);
  watched.driver().reconfigure({-1, 1, 1, 0, false});
  EXPECT_TRUE(watched.await(2, kLong));
}

}  // namespace test_laser_driver
