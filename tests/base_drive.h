// SPDX-License-Identifier: BSD-3-Clause
// A drive as the tests want it: two inputs, two locks, round limits, a converter that remembers.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/drive.h"

namespace kurumaisu::test {

constexpr double kPeriod = 0.02;

const AxisLaw kTranslation{{1.32402, 0.127906}, {2.07369, -0.108783}};
const AxisLaw kSteering{{-0.499211, 0.104181}, {-0.469278, -0.169476}};
const AxisLaw kSteeringCorrected{{-0.499211, -0.104181}, {-0.469278, 0.169476}};
const OdometryNoise kNoise{0.01, 0.0005, 0.001, 0.005, 0.02};

// Ramps that are over within a tick, where a test is not about ramps; and some that a person can sit through.
const RampLimits kSteep{1e4, 1e4, 1e8};
const Limits kQuick{1.5, 0.8, 1.2, kSteep, kSteep, 9.0, false};
const Limits kGentle{1.5, 0.8, 1.2, {0.8, 1.0, 4.0}, {2.0, 2.0, 15.0}, 1.0, false};

enum Input { kJoystick, kNavigation, kShared };
enum Lock { kHold, kDeadMan };

const ArbiterSettings kArbiter{
    {{"joystick", 200, 0.25, false, 0}, {"navigation", 50, 0.25, false, 0}, {"shared", 10, 0.25, true, 0}},
    {{"hold", 100, 0.0, true}},
    {10, 20}};

inline DriveSettings driveSettings(const Limits& limits) {
  const Channel wide{-9, 9, 0};
  return {kArbiter, 0.0, {0.5, 99.0}, {limits}, 0.1, {{kTranslation, kSteering}, wide, wide, 1.0, 2.5},
          kNoise};
}

class Recorder : public Dac {
 public:
  Output put(const Output& output) override {
    outputs.push_back(output);
    return output;
  }
  double patience() const override { return held_for; }
  const Output& last() const { return outputs.back(); }
  std::vector<Output> outputs;
  double held_for = std::numeric_limits<double>::infinity();  // [s]
};

/// A drive on a clock; say() is repeated at every tick.
class Chair {
 public:
  explicit Chair(const DriveSettings& settings) : drive(settings, dac) {}

  /// Ticks for so many seconds.
  void run(double seconds) {
    for (const double end = t + seconds - 0.5 * kPeriod; t < end;) {
      t += kPeriod;
      if (said) drive.command(said->input, said->publisher, said->rates, t);
      drive.tick(t);
    }
  }

  /// From now on somebody repeats this.
  void say(double v, double w, Input input = kNavigation, const std::string& publisher = "/a") {
    said = {input, publisher, {v, w}};
  }
  void silence() { said.reset(); }

  bool neutral() const {
    const Output& last = dac.last();
    return last.translation == 0 && last.steering == 0 && last.reference == 2.5 && last.v == 0 && last.w == 0;
  }

  struct Said {
    Input input;
    std::string publisher;
    Rates rates;
  };

  Recorder dac;
  Drive drive;
  double t = 100.0;
  std::optional<Said> said;
};

class DriveTest : public testing::Test {
 protected:
  DriveTest() { chair.run(0.3); }  // silent for longer than a timeout: whoever speaks now was released

  Chair chair{driveSettings(kQuick)};
};

/// With limits that take time.
class RideTest : public testing::Test {
 protected:
  RideTest() { chair.run(0.3); }

  Chair chair{driveSettings(kGentle)};
};

}  // namespace kurumaisu::test
