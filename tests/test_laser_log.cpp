// SPDX-License-Identifier: BSD-3-Clause
// The bytes of a real URG-04LX, as Player's hokuyo_aist recorded them: asked for scan by scan (GD), 13.5 s.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "laser/clock.h"
#include "laser/fan.h"
#include "laser/sequence.h"
#include "scip/message.h"
#include "scip/request.h"
#include "scip/scan.h"
#include "scip/sensor.h"

namespace test_laser_log {

namespace l = kurumaisu::laser;
namespace s = kurumaisu::scip;
namespace fs = std::filesystem;

namespace {

/// Bytes and when they came [s].
struct Record {
  double time = 0;
  std::string bytes;
};

std::uint32_t bigEndian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes) value = value << 8U | static_cast<unsigned char>(byte);
  return value;
}

/// Seconds, microseconds, length (each 32 bits), bytes.
std::vector<Record> records(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(file), {}};
  std::vector<Record> result;
  for (std::size_t at = 0; at + 12 <= all.size();) {
    const std::string_view head = std::string_view(all).substr(at, 12);
    const std::uint32_t length = bigEndian(head.substr(8, 4));
    result.push_back(
        {bigEndian(head.substr(0, 4)) + 1e-6 * bigEndian(head.substr(4, 4)), all.substr(at + 12, length)});
    at += 12 + length;
  }
  return result;
}

fs::path logged() { return fs::path(RECORDINGS) / "player_urg04lx" / "hokuyo_aist.logr"; }

struct Logged {
  std::vector<s::Message> messages;
  s::Assembler::Counts counts;
};

Logged readLog() {
  Logged log;
  s::Assembler assembler;
  for (const Record& record : records(logged())) {
    assembler.add(record.bytes, record.time);
    while (const std::optional<s::Message> message = assembler.next()) log.messages.push_back(*message);
  }
  log.counts = assembler.counts();
  return log;
}

class LaserLogTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(logged())) GTEST_SKIP() << "no " << logged() << ": it does not come with the repository";
    log = readLog();
    for (const s::Message& message : log.messages) {
      const std::optional<s::Request> asked = s::request(message.command);
      if (!asked) continue;
      EXPECT_EQ(message.command, "GD0046072201");
      rotations.push_back(s::decodeScan(message, *asked));
      first_bytes.push_back(message.first_byte);
    }
    ASSERT_EQ(rotations.size(), 121U);
  }

  s::Parameters sensor() const {
    const auto isSensor = [](const s::Message& message) { return message.command == "PP"; };
    return s::parameters(*std::find_if(log.messages.begin(), log.messages.end(), isSensor));
  }

  Logged log;
  std::vector<s::Rotation> rotations;
  std::vector<double> first_bytes;  // [s] of each
};

/// Sums of products of what differs from the mean, x with x and x with y, of some points.
std::pair<double, double> products(const std::vector<double>& x, const std::vector<double>& y,
                                   std::size_t from, std::size_t to) {
  const auto mean = [&](const std::vector<double>& v) {
    double total = 0;
    for (std::size_t i = from; i < to; ++i) total += v[i];
    return total / static_cast<double>(to - from);
  };
  const double mean_x = mean(x);
  const double mean_y = mean(y);
  std::pair<double, double> sums;
  for (std::size_t i = from; i < to; ++i) {
    sums.first += (x[i] - mean_x) * (x[i] - mean_x);
    sums.second += (x[i] - mean_x) * (y[i] - mean_y);
  }
  return sums;
}

// From this scan on the requests, and so the replies, come 72 ms later after the mirror than before.
constexpr std::size_t kBehind = 65;

}  // namespace

TEST_F(LaserLogTest, EverySumIsGoodAndEveryReplyRead) {
  EXPECT_EQ(log.messages.size(), 134U);
  EXPECT_EQ(log.counts.messages, 134U);
  EXPECT_EQ(log.counts.bad_sums, 0U);
  EXPECT_EQ(log.counts.unreadable, 0U);
  EXPECT_EQ(log.counts.cut, 0U);
  EXPECT_EQ(log.counts.stray_bytes, 0U);
  for (const s::Rotation& rotation : rotations) EXPECT_EQ(rotation.distances.size(), 677U);
}

TEST_F(LaserLogTest, TheFanIsTheSensorsOwn) {
  // hokuyo_aist asked for steps 46 to 722
  const s::Parameters urg = sensor();
  const l::Fan fan(urg, {urg.bearing(46), urg.bearing(722), 1, 0, false});
  EXPECT_EQ(fan.request().first, 46);
  EXPECT_EQ(fan.request().last, 722);
  std::size_t measured = 0;
  for (const s::Rotation& rotation : rotations) {
    const l::Scan scan = fan.convert(rotation, 0);
    for (const float range : scan.ranges) {
      ASSERT_FALSE(range < 0.02F || (range > 5.6F && std::isfinite(range))) << range;
      measured += std::isfinite(range) ? 1 : 0;
    }
  }
  EXPECT_GT(measured, 121U * 677U / 2);
}

TEST_F(LaserLogTest, TheClockRunsFastByAnEighthOfAPercent) {
  std::vector<double> device;
  l::DeviceClock clock(l::TimeMode::kEnvelope);
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    const double stamp = clock.stamp(rotations[i].clock, first_bytes[i], 722 * sensor().stepTime());
    EXPECT_LE(stamp, first_bytes[i]);
    device.push_back(1e-3 * rotations[i].clock);
  }
  // Least squares: one slope for the scans before and after they fell behind.
  const auto [before_xx, before_xy] = products(first_bytes, device, 0, kBehind);
  const auto [after_xx, after_xy] = products(first_bytes, device, kBehind, device.size());
  const double fitted = (before_xy + after_xy) / (before_xx + after_xx) - 1;
  EXPECT_NEAR(fitted, 0.00125, 0.0001);
  EXPECT_NEAR(clock.state().drift, fitted, 0.0001);
  EXPECT_EQ(clock.state().resets, 0U);
}

TEST_F(LaserLogTest, OnceTheDriftIsKnownStampsLieOnALine) {
  l::DeviceClock clock(l::TimeMode::kEnvelope);
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    clock.stamp(rotations[i].clock, first_bytes[i], 722 * sensor().stepTime());
    const double expected = i < kBehind ? 0 : 0.072;
    if (clock.state().span < 3) continue;
    EXPECT_NEAR(clock.state().latency, expected, 0.003) << i;
  }
}

/// A URG-04LX sends a scan once the mirror has come round: 100 ms after it began, 29.5 ms after step 722.
TEST_F(LaserLogTest, IiTellsWhatListeningCannot) {
  l::DeviceClock clock(l::TimeMode::kEnvelope);
  int told = 0;
  std::size_t scan = 0;
  for (const s::Message& message : log.messages) {
    if (message.command == "II") {
      const std::string time = s::keyed(message).at("TIME");
      clock.calibrate(static_cast<std::uint32_t>(std::stoul(time, nullptr, 16)), message.first_byte,
                      message.first_byte);
      ++told;
    } else if (s::request(message.command) && scan < kBehind) {
      clock.stamp(rotations[scan].clock, first_bytes[scan], 722 * sensor().stepTime());
      ++scan;
    }
  }
  EXPECT_EQ(told, 3);
  EXPECT_TRUE(clock.state().calibrated);
  EXPECT_NEAR(clock.state().send_delay, 0.028, 0.002);
}

TEST_F(LaserLogTest, TheGapIsReported) {
  l::Sequence sequence;
  std::vector<std::pair<std::size_t, std::uint64_t>> gaps;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    const std::uint64_t missing = sequence.missing(rotations[i].clock, first_bytes[i], sensor().scanTime());
    if (missing > 0) gaps.emplace_back(i, missing);
  }
  // 0.4 s before the fourth scan, in which hokuyo_aist asked for VV, PP and II
  EXPECT_EQ(gaps, (std::vector<std::pair<std::size_t, std::uint64_t>>{{3, 3}}));
  EXPECT_EQ(rotations[3].clock - rotations[2].clock, 400U);
}

}  // namespace test_laser_log
