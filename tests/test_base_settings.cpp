// SPDX-License-Identifier: BSD-3-Clause
// base_node's settings. No master: values are made here.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

#include "base/node/settings.h"
#include "base_values.h"

namespace test_base_settings {

namespace k = kurumaisu;
using namespace parameters;  // NOLINT: a test

namespace {

std::string complaintOf(const Value& value) {
  return complaint([&value] { k::readBaseSettings({value, "/base_node"}); });
}

}  // namespace

TEST(BaseSettings, AreReadFromAWholeConfiguration) {
  const k::BaseSettings settings = k::readBaseSettings({nodeValues(), "/base_node"});
  EXPECT_EQ(settings.law_name, "published");
  EXPECT_EQ(settings.drive.outlet.law.steering.negative.intercept, -0.169476);
  EXPECT_EQ(settings.drive.outlet.reference_voltage, 2.5);
  EXPECT_EQ(settings.drive.outlet.steering.resolution, 0.005);
  EXPECT_EQ(settings.topics.inputs, (std::vector<std::string>{"joy_vel", "cmd_vel"}));
  EXPECT_EQ(settings.drive.arbiter.inputs[1].name, "navigation");
  EXPECT_EQ(settings.drive.arbiter.inputs[1].limits, 1U);
  EXPECT_EQ(settings.drive.arbiter.locks[0].timeout, 0.3);
  EXPECT_EQ(settings.rate, 50.0);
}

TEST(BaseSettings, AGuardIsChosenByItsName) {
  Value v = nodeValues();
  EXPECT_FALSE(k::readBaseSettings({v, "/n"}).dac.guard);
  EXPECT_FALSE(k::readBaseSettings({v, "/n"}).drive.arbiter.first_word_is_rest);
  v["dac"]["kind"] = std::string("guard");
  EXPECT_TRUE(k::readBaseSettings({v, "/n"}).drive.arbiter.first_word_is_rest);
  const k::DacSettings dac = k::readBaseSettings({v, "/n"}).dac;
  EXPECT_EQ(dac.guard->socket, "/somewhere");
  EXPECT_EQ(dac.guard->reply_wait, 0.01);
  EXPECT_EQ(dac.silence, 0.15);
  EXPECT_EQ(dac.favour.priority, 20);
  EXPECT_EQ(dac.favour.longest_run, 0.05);
  EXPECT_EQ(dac.favour.nice, -20);
  v["guard"]["priority"] = 20;
  EXPECT_THROW(k::readBaseSettings({v, "/n"}), std::invalid_argument);
  v["guard"]["priority"] = 0;
  EXPECT_THROW(k::readBaseSettings({v, "/n"}), std::invalid_argument);
  v["dac"]["priority"] = 0;
  EXPECT_EQ(k::readBaseSettings({v, "/n"}).dac.favour.priority, 0);
  v["dac"]["kind"] = std::string("serial");
  EXPECT_EQ(complaint([&v] {
              k::readBaseSettings({v, "/n"});
            }),
            "/n/dac/kind: must be one of topic, guard: serial");
}

namespace {

Value effect(const std::string& id) {
  Value v;
  v["id"] = id;
  v["parameters"]["k"] = 0.1;
  return v;
}

Value processNoise() {
  Value v = effect("base.process_noise");
  Value parameters;
  parameters["sd_v"] = 0.01;
  parameters["sd_w"] = 0.02;
  parameters["tau"] = 0.3;
  parameters["growth"] = 0;
  v["parameters"] = parameters;
  return v;
}

}  // namespace

TEST(BaseSettings, MeasuredNoiseReplacesWhatWasAssumed) {
  Value v = nodeValues();
  v["model"]["effects"][0] = effect("laser.scale");
  v["model"]["effects"][1] = effect("base.marker_x");  // of what measures, not of the chair
  EXPECT_EQ(k::readBaseSettings({v, "/n"}).drive.noise.heading_per_turn, 0.01);
  v["model"]["effects"][2] = processNoise();
  const k::BaseSettings settings = k::readBaseSettings({v, "/n"});
  EXPECT_EQ(settings.drive.noise.heading_per_turn, 0);
  EXPECT_EQ(settings.drive.noise.rates.sd_w, 0.02);
  EXPECT_EQ(settings.drive.noise.rates.tau, 0.3);
  EXPECT_TRUE(settings.effects.unfollowed.empty());
}

TEST(BaseSettings, EffectsThatOdometryDoesNotFollowKeepTheAssumedGrowth) {
  Value v = nodeValues();
  v["model"]["effects"][0] = processNoise();
  v["model"]["effects"][1] = effect("base.lag_v");
  const k::BaseSettings settings = k::readBaseSettings({v, "/n"});
  EXPECT_EQ(settings.drive.noise.heading_per_turn, 0.01);
  EXPECT_EQ(settings.drive.noise.rates.sd_w, 0.02);
  EXPECT_EQ(settings.effects.unfollowed, std::vector<std::string>{"base.lag_v"});
}

TEST(BaseSettings, AMeasuredNoiseThatMakesNoSenseIsRefused) {
  Value v = nodeValues();
  v["model"]["effects"][0] = processNoise();
  v["model"]["effects"][0]["parameters"]["tau"] = 0.0;
  EXPECT_EQ(complaintOf(v), "/base_node/model/effects[0]/parameters/tau: must be above 0: 0");
  v["model"]["effects"][0] = processNoise();
  v["model"]["effects"][1] = processNoise();
  EXPECT_NE(complaintOf(v).find("/base_node/model/effects[1]/id: is given twice"), std::string::npos);
  v = nodeValues();
  v["model"]["effects"] = std::string("none");
  EXPECT_NE(complaintOf(v).find("/base_node/model/effects: must be a list"), std::string::npos);
}

TEST(BaseSettings, TheImuIsReadButOnlyUsedWhereWanted) {
  Value v = nodeValues();
  EXPECT_FALSE(k::readBaseSettings({v, "/n"}).drive.gyro);
  v["odometry"]["imu"]["use"] = true;
  v["odometry"]["imu"]["axis"] = std::string("down");
  const k::BaseSettings settings = k::readBaseSettings({v, "/n"});
  ASSERT_TRUE(settings.drive.gyro);
  EXPECT_EQ(settings.odometry.imu->axis, k::ImuSettings::Axis::kDown);
  v["odometry"]["imu"]["axis"] = std::string("left");
  EXPECT_EQ(complaintOf(v), "/base_node/odometry/imu/axis: must be one of tf, up, down: left");
}

TEST(BaseSettings, EveryMistakeIsNamed) {
  Value v = nodeValues();
  v["longest_stepp"] = 0.3;
  EXPECT_EQ(complaintOf(v), "/base_node/longest_stepp: is not a known key; its value is 0.3");

  v = nodeValues();
  v["model"]["voltage_law"] = std::string("publshed");
  EXPECT_EQ(complaintOf(v), "/base_node/model/voltage_law: must be one of custom, published: publshed");

  v = nodeValues();  // in a law that is not in use
  v["model"]["voltage_laws"]["custom"]["steering"]["positive"]["slope"] = 0;
  EXPECT_EQ(complaintOf(v), "/base_node/model/voltage_laws/custom/steering/positive/slope: must not be 0: 0");

  v = nodeValues();
  v["model"]["voltage_laws"]["custom"]["steering"]["positive"]["slope"] = 0.5;
  EXPECT_NE(complaintOf(v).find("/base_node/model/voltage_laws/custom/steering: the slopes"),
            std::string::npos);

  v = nodeValues();
  v["rate"] = 0;
  EXPECT_EQ(complaintOf(v), "/base_node/rate: must be from 0.1 to 1000: 0");

  v = nodeValues();
  v["odometry"]["noise"]["heading_per_turn"] = -0.01;
  EXPECT_EQ(complaintOf(v), "/base_node/odometry/noise/heading_per_turn: must be at least 0: -0.01");

  v = nodeValues();
  v["model"]["wheels"] = 4;
  EXPECT_EQ(complaintOf(v), "/base_node/model/wheels: is not a known key; its value is 4");
}

TEST(BaseSettings, AnInputALockOrASetThatMakesNoSenseIsNamed) {
  const auto expect = [](const std::function<void(Value&)>& change, const std::string& words) {
    Value v = nodeValues();
    change(v);
    EXPECT_NE(complaintOf(v).find(words), std::string::npos) << complaintOf(v);
  };
  expect([](Value& v) { v["inputs"]["navigation"]["priority"] = 256; },
         "/base_node/inputs/navigation/priority: must be at most 255: 256");
  expect([](Value& v) { v["inputs"]["navigation"]["priority"] = 200; },
         "/base_node/inputs/navigation/priority: must differ from that of joystick: 200");
  expect([](Value& v) { v["inputs"]["navigation"]["limits"] = std::string("fast"); },
         "/base_node/inputs/navigation/limits: must be one of gentle, ride: fast");
  expect([](Value& v) { v["inputs"]["navigation"]["timeout"] = 0; }, "/timeout: must be above 0: 0");
  expect([](Value& v) { v["inputs"]["navigation"]["topc"] = 0; },
         "/base_node/inputs/navigation/topc: is not a known key");
  expect([](Value& v) { v["locks"]["dead_man"]["topic"] = std::string("cmd_vel"); },
         "/base_node: names the topic cmd_vel twice");
  expect([](Value& v) { v["locks"]["dead_man"]["timeout"] = -0.1; }, "/timeout: must be at least 0: -0.1");
  expect([](Value& v) { v["rate"] = 1e9; }, "/base_node/rate: must be from 0.1 to 1000: 1e+09");
  expect([](Value& v) { v["odometry"]["child_frame"] = std::string("/odom"); },
         "/child_frame: must differ from frame: odom");
  expect([](Value& v) { v["odometry"]["frame"] = std::string("odom 2"); },
         "/frame: must be a frame's name without blanks: odom 2");
  expect([](Value& v) { v["odometry"]["frame"] = std::string("/"); },
         "/frame: must be a frame's name without blanks: /");
  expect([](Value& v) { v["rest"]["w"] = 30; }, "/base_node/absurd/w: must be above 30");
  expect([](Value& v) { v["limits"]["ride"]["w_jerk"] = 0; },
         "/base_node/limits/ride/w_jerk: must be above 0: 0");
  expect([](Value& v) { v["longest_step"] = 0.001; }, "/base_node/longest_step: must be at least one period");
  expect([](Value& v) { v["speed_cap"]["fallback"] = -1; },
         "/base_node/speed_cap/fallback: must be at least");
}

// Fault 10
TEST(BaseSettings, ACalibrationThatCannotBeRightIsRefused) {
  const auto expect = [](const std::function<void(Value&)>& change, const std::string& words) {
    Value v = nodeValues();
    change(v["model"]);
    EXPECT_EQ(complaintOf(v), "/base_node/model/" + words);
  };
  expect([](Value& m) { m["voltage_laws"]["custom"] = law(1); },
         "voltage_laws/custom/steering: is not monotonic: its branches overlap from -0.169476 to 0.104181 V");
  expect(
      [](Value& m) { m["voltage_laws"]["custom"]["translation"]["negative"] = branch(2.0, 0.1); },
      "voltage_laws/custom/translation: is not monotonic: neutral, 0 V, lies outside its dead zone, 0.1 to "
      "0.127906 V");
  expect([](Value& m) { m["voltages"]["steering"]["min"] = 0.1; },
         "voltages/steering: neutral, 0 V, must lie inside its band: min 0.1, max 2");
  expect([](Value& m) { m["voltages"]["translation"]["max"] = 0.1; },
         "voltages/translation: the band (-2, 0.1) V does not reach beyond the law's intercept 0.127906 V");
  expect([](Value& m) { m["voltages"]["knob"] = 0.0; },
         "voltages/translation: resolution must leave a code on either side of neutral: 0.005");
  expect([](Value& m) { m["voltages"]["knob"] = 1.1; }, "voltages/knob: must be from 0 to 1: 1.1");
  expect([](Value& m) { m["voltages"]["steering"]["resolution"] = 2.5; },
         "voltages/steering: resolution must leave a code on either side of neutral: 2.5");
  expect([](Value& m) { m["reference_voltage"] = 5.5; },
         "voltages/reference: reference_voltage 5.500000 V must lie from min 0.000000 to max 5.000000");
}

namespace {

Value garbage(std::mt19937_64& random) {
  switch (random() % 8) {
    case 0:
      return static_cast<int>(random());
    case 1:
      return std::numeric_limits<double>::quiet_NaN();
    case 2:
      return std::ldexp(1.0, static_cast<int>(random() % 2000) - 1000) * (random() % 2 ? 1 : -1);
    case 3:
      return std::string(random() % 20, static_cast<char>(random() % 256));
    case 4:
      return static_cast<bool>(random() % 2);
    case 5: {
      Value list;
      for (int i = static_cast<int>(random() % 3); i >= 0; --i) list[i] = garbage(random);
      return list;
    }
    case 6: {
      Value tree;
      for (int i = static_cast<int>(random() % 3); i >= 0; --i)
        tree[std::string(1, static_cast<char>('a' + i))] = garbage(random);
      return tree;
    }
    default:
      return {};
  }
}

/// Puts garbage in the place of one value somewhere below, or beside it.
void spoil(Value& value, std::mt19937_64& random) {
  if (value.getType() != Value::TypeStruct || value.size() == 0 || random() % 9 == 0) {
    value = garbage(random);
    return;
  }
  auto it = value.begin();
  std::advance(it, random() % static_cast<unsigned>(value.size()));
  if (random() % 15 == 0) {
    value[it->first + "x"] = garbage(random);
  } else {
    spoil(it->second, random);
  }
}

}  // namespace

// Fault 16
TEST(BaseSettings, GarbageOnTheParameterServerIsRefusedOrHarmless) {
  std::mt19937_64 random(16);
  int refused = 0;
  for (int i = 0; i < 4000; ++i) {
    Value v = nodeValues();
    for (int n = static_cast<int>(random() % 3); n >= 0; --n) spoil(v, random);
    try {
      const k::BaseSettings settings = k::readBaseSettings({v, "/base_node"});
      ASSERT_TRUE(settings.rate > 0 && std::isfinite(settings.rate));
      for (const k::Limits& limits : settings.drive.limits) ASSERT_GT(limits.v_ramp.deceleration, 0);
      ASSERT_GT(settings.drive.outlet.translation.max, 0);
      ASSERT_LT(settings.drive.outlet.translation.min, 0);
    } catch (const std::invalid_argument& problem) {
      ++refused;
      ASSERT_EQ(std::string(problem.what()).rfind("/base_node", 0), 0U) << problem.what();
    }
  }
  EXPECT_GT(refused, 2000);
}

}  // namespace test_base_settings
