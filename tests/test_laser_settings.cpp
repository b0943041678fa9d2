// SPDX-License-Identifier: BSD-3-Clause
// laser_node's parameters over those shipped, and its diagnostics in words. No master, no sensor.
#include <gtest/gtest.h>
#include <kurumaisu/LaserConfig.h>

#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "laser/settings.h"
#include "laser/shipped.h"

namespace test_laser_settings {

namespace k = kurumaisu::laser;
using Value = XmlRpc::XmlRpcValue;

namespace {

const std::string kShipped = SHIPPED "/laser_node.yaml";

k::NodeSettings read(const Value& given) { return k::readSettings(k::loadShipped(kShipped), given, "/n"); }

std::string complaint(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

template <typename T>
std::string complaintOf(const std::string& key, const T& value) {
  Value given;
  given[key] = value;
  return complaint([&given] { read(given); });
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST(LaserSettings, NothingGivenIsAllAsShipped) {
  const k::NodeSettings settings = read({});
  EXPECT_EQ(settings.driver.serial_port, "/dev/ttyACM0");
  EXPECT_EQ(settings.driver.ip_address, "");
  EXPECT_EQ(settings.driver.serial_baud, 115200);
  EXPECT_EQ(settings.driver.ip_port, 10940);
  EXPECT_EQ(settings.frame_id, "laser");
  EXPECT_NEAR(settings.driver.live.angle_min, -3.14159, 1e-9);
  EXPECT_EQ(settings.driver.live.cluster, 1);
  EXPECT_FALSE(settings.driver.live.intensity);
  EXPECT_TRUE(settings.warnings.empty());
}

// The parameters of urg_node's own urg_lidar.launch, and those of a sensor on Ethernet.
TEST(LaserSettings, LaunchFilesForUrgNodeWork) {
  Value serial;
  serial["ip_address"] = std::string();
  serial["serial_port"] = std::string("/dev/ttyACM1");
  serial["serial_baud"] = 115200;
  serial["frame_id"] = std::string("/front/laser");
  serial["calibrate_time"] = true;
  serial["publish_intensity"] = false;
  serial["publish_multiecho"] = false;
  serial["angle_min"] = -1.5707963;
  serial["angle_max"] = 1.5707963;
  const k::NodeSettings settings = read(serial);
  EXPECT_EQ(settings.driver.serial_port, "/dev/ttyACM1");
  EXPECT_TRUE(settings.driver.calibrate_time);
  EXPECT_EQ(settings.frame_id, "front/laser");
  ASSERT_EQ(settings.warnings.size(), 1U);
  EXPECT_TRUE(contains(settings.warnings[0], "LASER_FRAME_SLASH")) << settings.warnings[0];

  Value ethernet;
  ethernet["ip_address"] = std::string("192.168.0.10");
  EXPECT_EQ(read(ethernet).driver.ip_address, "192.168.0.10");
  EXPECT_EQ(read(ethernet).driver.serial_port, "");
}

TEST(LaserSettings, WhatIsAskedInVainIsSaid) {
  for (const char* key : {"publish_multiecho", "synchronize_time", "get_detailed_status"}) {
    Value given;
    given[key] = false;
    EXPECT_TRUE(read(given).warnings.empty()) << key;
    given[key] = true;
    ASSERT_EQ(read(given).warnings.size(), 1U) << key;
    EXPECT_TRUE(contains(read(given).warnings[0], "LASER_IGNORED_PARAMETER: /n/" + std::string(key)));
  }
  Value prefix;
  prefix["tf_prefix"] = std::string("robot");
  EXPECT_EQ(read(prefix).warnings.size(), 1U);
  Value analyzers;
  analyzers["analyzers"]["hokuyo"]["path"] = std::string("Hokuyo");
  EXPECT_TRUE(read(analyzers).warnings.empty());
}

TEST(LaserSettings, WhatMakesNoSenseStopsTheStart) {
  const auto says = [](const std::string& message, const std::string& words) {
    EXPECT_TRUE(contains(message, words)) << message << " instead of " << words;
  };
  says(complaintOf("angel_min", 0.0), "/n/angel_min: is not a known key");
  says(complaintOf("angle_min", -4.0), "/n/angle_min: must be from");
  says(complaintOf("angle_max", 180), "/n/angle_max: must be from");
  says(complaintOf("angle_min", std::numeric_limits<double>::quiet_NaN()), "/n/angle_min: must be finite");
  says(complaintOf("angle_max", std::string("1e-3")), "/n/angle_max: must be a number, not 1e-3");
  says(complaintOf("cluster", 0), "/n/cluster: must be at least 1");
  says(complaintOf("cluster", 100), "/n/cluster: must be at most 99");
  says(complaintOf("cluster", 1.0), "/n/cluster: must be an integer");
  says(complaintOf("skip", -1), "/n/skip: must be at least 0");
  says(complaintOf("skip", 10), "/n/skip: must be at most 9");
  says(complaintOf("serial_baud", 0), "/n/serial_baud: must be at least 1");
  says(complaintOf("ip_port", 65536), "/n/ip_port: must be at most 65535");
  says(complaintOf("serial_port", std::string()), "/n/serial_port: is empty");
  says(complaintOf("frame_id", std::string("/")), "frame_id must not be empty");
  says(complaintOf("time_offset", 10.5), "/n/time_offset: must be from");
  says(complaintOf("time_mode", std::string("firmware")),
       "/n/time_mode: must be one of envelope, device, host");
  says(complaintOf("calibrate_time", 1), "/n/calibrate_time: must be true or false");
  says(complaintOf("error_limit", -1), "/n/error_limit: must be at least 0");
  says(complaintOf("stale_timeout", -0.5), "/n/stale_timeout: must be above 0");
  says(complaintOf("reconnect_delay_max", 0.01), "/n/reconnect_delay_max: must be at least 0.1");
  says(complaintOf("diagnostics_tolerance", -0.1), "/n/diagnostics_tolerance: must be from");
  says(complaintOf("diagnostics_window_time", 0.0), "/n/diagnostics_window_time: must be above 0");
  for (const char* key : {"connect_timeout", "answer_timeout", "reconnect_delay_min", "diagnostic_period"}) {
    says(complaintOf(key, -1.0), "/n/" + std::string(key) + ": must be above 0");
  }
}

TEST(LaserSettings, ContradictionsStopTheStart) {
  Value both;
  both["ip_address"] = std::string("192.168.0.10");
  both["serial_port"] = std::string("/dev/ttyACM0");
  EXPECT_TRUE(contains(complaint([&] { read(both); }), "/n/serial_port: contradicts ip_address"));
  Value turned;
  turned["angle_min"] = 1.0;
  turned["angle_max"] = 1.0;
  EXPECT_TRUE(contains(complaint([&] { read(turned); }), "angle_min must be less than angle_max: 1, 1"));
  Value time;
  time["time_mode"] = std::string("device");
  time["calibrate_time"] = true;
  EXPECT_TRUE(contains(complaint([&] { read(time); }), "/n/calibrate_time: contradicts time_mode device"));
}

// dynamic_reconfigure cuts what it is asked for to the limits of msg/Laser.cfg before the node sees it.
TEST(LaserSettings, LimitsAreThoseOfReconfigure) {
  const auto& low = kurumaisu::LaserConfig::__getMin__();
  const auto& high = kurumaisu::LaserConfig::__getMax__();
  Value given;
  given["angle_min"] = low.angle_min;
  given["angle_max"] = high.angle_max;
  given["time_offset"] = high.time_offset;
  given["cluster"] = high.cluster;
  given["skip"] = high.skip;
  EXPECT_EQ(complaint([&] { read(given); }), "");
  given["angle_min"] = -3.1416;  // a rounded pi is one
  EXPECT_EQ(read(given).driver.live.angle_min, low.angle_min);
  EXPECT_NE(complaintOf("time_offset", low.time_offset - 1e-6), "");
  EXPECT_NE(complaintOf("time_offset", high.time_offset + 1e-6), "");
  EXPECT_NE(complaintOf("cluster", high.cluster + 1), "");
  EXPECT_NE(complaintOf("cluster", low.cluster - 1), "");
  EXPECT_NE(complaintOf("skip", high.skip + 1), "");
}

TEST(LaserSettings, ShippedFileIsNamedWhereItIsWrong) {
  EXPECT_TRUE(
      contains(complaint([] { k::loadShipped("/nowhere/laser_node.yaml"); }), "/nowhere/laser_node.yaml"));
}

}  // namespace test_laser_settings
