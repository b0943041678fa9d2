// SPDX-License-Identifier: BSD-3-Clause
// The driver against the virtual sensor, with every fault that it has.
#include <gtest/gtest.h>

#include <functional>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "laser_watched.h"

namespace test_laser_driver_faults {

using namespace watching;  // NOLINT: a test

namespace {

constexpr double kPeriod = 0.1;  // [s] of the sensors below
constexpr double kAway = 0.5;    // [s] for which it is away, where it is

/// What a fault may cost.
struct Cost {
  double gap = kPeriod;  // [s] the longest, but for this computer's lateness
  std::uint64_t lost = 0;
  std::function<bool(const l::Counts&)> counted = [](const l::Counts&) { return true; };
  std::string told;  // code
};

Cost free() { return {}; }

Cost recovered(double away, const std::string& told) {
  return {away + kRecovery, 99, [](const l::Counts& counts) { return counts.reconnects == 1; }, told};
}

/// What must hold whatever happened.
void expectTruth(const Result& result, bool clock_goes = true) {
  for (std::size_t i = 0; i < result.scans.size(); ++i) {
    const auto& [time, scan] = result.scans[i];
    EXPECT_GT(time - scan.stamp, 0.05) << i;
    EXPECT_LT(time - scan.stamp, 0.2 + result.jitter) << i;
    if (i == 0) continue;
    EXPECT_GE(scan.stamp, result.scans[i - 1].scan.stamp) << i;
    const bool goes_on = scan.clock != result.scans[i - 1].scan.clock;
    EXPECT_TRUE(goes_on == clock_goes || result.status.counts.reconnects > 0) << i;
  }
  EXPECT_LT(result.cpu, 0.05);
  EXPECT_LT(result.stopping, 0.25 + result.jitter);
  EXPECT_EQ(result.status.counts.scans, result.scans.size());
}

const std::map<std::string, Cost>& streamFaults() {
  static const auto damaged = [](const l::Counts& c) { return c.damaged == 1 && c.bad_sums == 1; };
  static const auto unreadable = [](const l::Counts& c) { return c.unreadable == 1; };
  const auto status = [](const char* number) {
    return [number](const l::Counts& c) { return c.errors.count(number) == 1 && c.errors.at(number) == 1; };
  };
  static const std::map<std::string, Cost> faults{
      {"corrupt@5", {2 * kPeriod, 1, damaged, "LASER_DAMAGED"}},
      {"trunc@5", {3 * kPeriod, 2, [](const l::Counts& c) { return c.unreadable + c.damaged >= 1; }, ""}},
      {"noend@5", {3 * kPeriod, 2, unreadable, "LASER_UNREADABLE"}},
      {"badlf@1", {kPeriod, 1, unreadable, "LASER_UNREADABLE"}},
      {"badlf@5", {2 * kPeriod, 1, unreadable, "LASER_UNREADABLE"}},
      {"garbage", {kPeriod, 0, [](const l::Counts& c) { return c.stray_bytes > 0; }, ""}},
      {"dup@5", {kPeriod, 0, [](const l::Counts& c) { return c.duplicates == 1; }, "LASER_DUPLICATE"}},
      {"err50@5", {2 * kPeriod, 1, status("50"), "LASER_STATUS: the sensor reports 50"}},
      {"err98@5", {2 * kPeriod, 1, status("98"), "LASER_STATUS: the sensor reports 98"}},
      {"stall@5", recovered(0, "")},
      {"stall@5=0.5", recovered(kAway, "")},
      {"close@5", recovered(0, "LASER_CLOSED")},
      {"rst@5", recovered(0, "LASER_CLOSED")},
      {"hangup@5=0.5", recovered(kAway, "LASER_CLOSED")},
      {"reboot@5=0", recovered(0, "")},
      {"reboot@5=0.5", recovered(kAway, "")},
      {"t0=16776716", free()},
      {"dribble", free()},
      {"vv-badsum", {kPeriod, 0, [](const l::Counts& c) { return c.bad_sums > 0; }, "LASER_BAD_SUM: VV"}},
      {"vv-badsum vv-deaf=0.5",
       {kPeriod, 0, [](const l::Counts& c) { return c.bad_sums > 0; },
        "LASER_BAD_SUM: VV, which is asked once"}},
      {"t-stands", free()},
      {"scip1", free()},
  };
  return faults;
}

std::vector<std::string> split(const std::string& words) {
  std::istringstream text(words);
  return {std::istream_iterator<std::string>(text), {}};
}

void expectCosts(bool serial) {
  Cases cases;
  for (const auto& [faults, cost] : streamFaults()) cases[faults] = {split(faults), serial};
  for (const auto& [name, result] : runAll(cases)) {
    SCOPED_TRACE((serial ? "pty " : "tcp ") + name);
    const Cost& cost = streamFaults().at(name);
    expectTruth(result, name.find("t-stands") == std::string::npos);
    ASSERT_GE(result.scans.size(), cases.at(name).scans) << result.status.last_error;
    for (const Came& came : result.scans) ASSERT_NO_FATAL_FAILURE(expectRoom(came.scan));
    EXPECT_LE(result.longestGap(), cost.gap + result.jitter);
    EXPECT_LE(result.status.counts.lost, cost.lost);
    EXPECT_TRUE(cost.counted(result.status.counts));
    EXPECT_TRUE(cost.told.empty() || result.tells(cost.told));
  }
}

}  // namespace

/// One bad frame costs one scan, a sensor that was away is back in 0.6 s, and nothing false is ever published.
TEST(Driver, BearsEveryFaultOfAStream) {
  for (const bool serial : {false, true}) expectCosts(serial);
}

/// RS-232: at power-up SCIP 1.1 at 19200 baud, and what comes at another rate is garbage.
TEST(Driver, FindsAColdSensorAtItsRate) {
  const std::map<std::string, double> away{{"strict-baud", 0},
                                           {"reboot@5=0", 0},
                                           {"reboot@5=0.5", kAway},
                                           {"hangup@5=0.5", kAway},
                                           {"stall@5", 0}};
  Cases cases;
  for (const auto& [fault, time] : away) cases[fault] = {{"strict-baud", fault}, true, "urg_04lx"};
  for (const auto& [name, result] : runAll(cases)) {
    SCOPED_TRACE(name);
    expectTruth(result);
    ASSERT_GE(result.scans.size(), cases.at(name).scans) << result.status.last_error;
    for (const Came& came : result.scans) ASSERT_NO_FATAL_FAILURE(expectRoom(came.scan));
    EXPECT_LE(result.longestGap(), away.at(name) + kRecovery + result.jitter);
    EXPECT_EQ(result.status.device.baud, 115200);
  }
}

/// What cannot work is told, without a spin, a hang or a scan.
TEST(Driver, TellsWhySensorsRefuse) {
  struct Refusal {
    l::State state;
    std::string told;
  };
  using l::State;
  const std::map<std::string, Refusal> refusals{
      {"bm01", {State::kRefused, "LASER_NO_LIGHT: BM is answered by status 01"}},
      {"md0e", {State::kRefused, "LASER_REFUSED: MD0044072501000 is answered by status 0E"}},
      {"pp-ares0", {State::kRefused, "LASER_BAD_PP: the sensor sends impossible values: PP: ARES"}},
      {"pp-crossed", {State::kRefused, "LASER_BAD_PP: the sensor sends impossible values: PP: AMIN 725"}},
      {"blackhole", {State::kConnecting, "LASER_NO_PORT"}},
      {"close-on-accept", {State::kConnecting, "LASER_CLOSED"}},
      {"rst-after-cmd", {State::kConnecting, "LASER_CLOSED"}}};
  Cases cases;
  for (const auto& [fault, refusal] : refusals) cases[fault] = {{fault}, false, "urg_04lx_ug01", 1, 1.0};
  for (const auto& [name, result] : runAll(cases)) {
    SCOPED_TRACE(name);
    expectTruth(result);
    EXPECT_EQ(result.scans.size(), 0U);
    EXPECT_EQ(result.status.state, refusals.at(name).state) << l::name(result.status.state);
    EXPECT_TRUE(result.tells(refusals.at(name).told)) << result.status.last_error;
    EXPECT_GE(result.status.counts.attempts, 2U);
    EXPECT_LE(result.status.counts.attempts, 11U);
  }
}

}  // namespace test_laser_driver_faults
