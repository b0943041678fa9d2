// SPDX-License-Identifier: BSD-3-Clause
// What diagnostics say of a sensor's state: level and words.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "laser/diagnosis.h"

namespace test_laser_diagnosis {

namespace k = kurumaisu::laser;

namespace {

k::DriverSettings onTty() {
  k::DriverSettings settings{};
  settings.serial_port = "/dev/ttyACM0";
  settings.serial_baud = 115200;
  return settings;
}

k::Status streaming() {
  k::Status status;
  status.state = k::State::kStreaming;
  status.counts.scans = 100;
  status.scan_period = 0.1;
  status.last_scan_time = 50.0;
  status.device.version = {
      {"VEND", "Hokuyo Automatic Co.,Ltd."}, {"FIRM", "3.1.00(18/Jan./2007)"}, {"SERI", "H0614967"}};
  status.device.state = {{"STAT", "Sensor works well."}};
  return status;
}

k::Diagnosis device(const k::Status& status, const k::Counts& before) {
  return k::diagnoseDevice(status, before, onTty(), 0);
}

std::map<std::string, std::string> valuesOf(const k::Diagnosis& diagnosis) {
  return {diagnosis.values.begin(), diagnosis.values.end()};
}

k::Diagnosis scans(const k::Status& status, std::optional<double> rate, double now) {
  return k::diagnoseScans(status, rate, now, 0.05, 0.5);
}

}  // namespace

TEST(DeviceDiagnosis, GoodIsOkAndNamesTheSensor) {
  const k::Status status = streaming();
  const k::Diagnosis diagnosis = device(status, status.counts);
  EXPECT_EQ(diagnosis.level, k::Level::kOk);
  EXPECT_EQ(diagnosis.summary, "Streaming");
  auto values = valuesOf(diagnosis);
  EXPECT_EQ(values["Vendor Name"], "Hokuyo Automatic Co.,Ltd.");
  EXPECT_EQ(values["Firmware Version"], "3.1.00");
  EXPECT_EQ(values["Firmware Date"], "18/Jan./2007");
  EXPECT_EQ(values["Device ID"], "H0614967");
  EXPECT_EQ(values["Serial Port"], "/dev/ttyACM0");
  EXPECT_EQ(values.count("IP Address"), 0U);
}

TEST(DeviceDiagnosis, EachTroubleSinceTheLastReportWarnsOnce) {
  using Count = std::uint64_t k::Counts::*;
  const std::pair<Count, std::string> troubles[] = {
      {&k::Counts::bad_sums, "bad sums: 2"},     {&k::Counts::unreadable, "unreadable replies: 2"},
      {&k::Counts::damaged, "damaged scans: 2"}, {&k::Counts::duplicates, "duplicate scans: 2"},
      {&k::Counts::lost, "lost scans: 2"},       {&k::Counts::reconnects, "reconnects: 2"}};
  for (const auto& [count, words] : troubles) {
    k::Status status = streaming();
    const k::Counts before = status.counts;
    status.counts.*count += 2;
    EXPECT_EQ(device(status, before).level, k::Level::kWarn) << words;
    EXPECT_EQ(device(status, before).summary, words);
    EXPECT_EQ(device(status, status.counts).level, k::Level::kOk) << words;
  }
  k::Status status = streaming();
  status.counts.errors["50"] = 3;
  EXPECT_EQ(device(status, {}).summary, "errors of the sensor: 3");
  EXPECT_EQ(device(status, {}).level, k::Level::kError);
  EXPECT_EQ(device(status, status.counts).level, k::Level::kOk);
  k::Status over = streaming();
  over.counts.errors["98"] = 1;
  EXPECT_EQ(device(over, {}).level, k::Level::kWarn);
  EXPECT_EQ(valuesOf(device(status, {}))["Errors of Status 50"], "3");
}

TEST(DeviceDiagnosis, AbnormalStatusIsAnErrorInItsOwnWords) {
  k::Status status = streaming();
  for (const char* well : {"Sensor works well.", "Stable 000 no error.", "sensor is working normally"}) {
    status.device.state["STAT"] = well;
    EXPECT_EQ(device(status, status.counts).level, k::Level::kOk) << well;
  }
  status.device.state["STAT"] = "Laser malfunction";
  EXPECT_EQ(device(status, status.counts).level, k::Level::kError);
  EXPECT_EQ(device(status, status.counts).summary, "Abnormal status: Laser malfunction");
}

TEST(DeviceDiagnosis, LevelsFollowTheState) {
  const std::pair<k::State, k::Level> expected[] = {
      {k::State::kStopped, k::Level::kStale}, {k::State::kConnecting, k::Level::kError},
      {k::State::kStarting, k::Level::kWarn}, {k::State::kStreaming, k::Level::kOk},
      {k::State::kRefused, k::Level::kError}, {k::State::kMisconfigured, k::Level::kError}};
  for (const auto& [state, level] : expected) {
    k::Status status = streaming();
    status.state = state;
    EXPECT_EQ(device(status, status.counts).level, level) << k::name(state);
  }
  k::Status status = streaming();
  status.state = k::State::kConnecting;
  status.last_error = "LASER_NO_PORT: gone";
  EXPECT_EQ(device(status, status.counts).summary,
            "Not connected: " + std::string(k::name(status.state)) + ": LASER_NO_PORT: gone");
}

TEST(ScanDiagnosis, RateWithinToleranceIsOk) {
  EXPECT_EQ(scans(streaming(), 9.6, 50.1).level, k::Level::kOk);
  EXPECT_EQ(scans(streaming(), 9.4, 50.1).level, k::Level::kWarn);
  EXPECT_EQ(scans(streaming(), 10.6, 50.1).level, k::Level::kWarn);
  EXPECT_EQ(scans(streaming(), 9.4, 50.1).summary, "9.40 scans a second instead of 10.00");
  EXPECT_EQ(scans(streaming(), std::nullopt, 50.1).level, k::Level::kOk);
}

TEST(ScanDiagnosis, SilenceIsStale) {
  EXPECT_EQ(scans(streaming(), 10.0, 50.55).level, k::Level::kOk);
  EXPECT_EQ(scans(streaming(), 10.0, 50.7).level, k::Level::kStale);
  EXPECT_EQ(scans(k::Status{}, std::nullopt, 50.0).level, k::Level::kStale);
  EXPECT_EQ(scans(k::Status{}, std::nullopt, 50.0).summary, "No scan yet");
}

TEST(Rhythm, CountsIntervalsOfTheWindow) {
  k::Rhythm rhythm(5.0);
  EXPECT_FALSE(rhythm.rate(0).has_value());
  for (int i = 0; i < 4; ++i) rhythm.add(1.0 * i);  // one a second: five in a window would be 20 % off
  EXPECT_DOUBLE_EQ(rhythm.rate(3.5).value(), 1.0);
  EXPECT_DOUBLE_EQ(rhythm.rate(6.5).value(), 1.0);  // 2 s and 3 s are left
  EXPECT_FALSE(rhythm.rate(7.5).has_value());
  rhythm.add(1.0);  // time was set back
  EXPECT_FALSE(rhythm.rate(1.0).has_value());
  rhythm.add(1.5);
  EXPECT_DOUBLE_EQ(rhythm.rate(1.5).value(), 2.0);
}

}  // namespace test_laser_diagnosis
