// SPDX-License-Identifier: BSD-3-Clause
// Equations (1)-(4) against values computed by hand from the paper's coefficients.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "model/laser_error.h"
#include "model/unicycle.h"
#include "model/voltage_law.h"

namespace test_model {

namespace k = kurumaisu;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const k::AxisLaw kTranslation{{1.32402, 0.127906}, {2.07369, -0.108783}};
const k::AxisLaw kTranslationFigure10{{1.32402, 0.1}, {2.07369, -0.1}};
const k::AxisLaw kSteering{{-0.499211, 0.104181}, {-0.469278, -0.169476}};
const k::AxisLaw kSteeringCorrected{{-0.499211, -0.104181}, {-0.469278, 0.169476}};
const k::LaserError kLaser{1.004587, 0.058826, {0.002334, -0.000488, 0.000199}, 0.001, 0.06, 4.0};

int signOf(double value) { return (value > 0) - (value < 0); }

}  // namespace

TEST(VoltageLaw, Equation1) {
  EXPECT_NEAR(kTranslation.volts(0.5), 0.789916, 1e-12);
  EXPECT_NEAR(kTranslation.volts(1.0), 1.451926, 1e-12);
  EXPECT_NEAR(kTranslation.volts(-0.5), -1.145628, 1e-12);
  EXPECT_NEAR(kTranslation.volts(1e-12), 0.127906, 1e-11);
  EXPECT_NEAR(kTranslation.volts(-1e-12), -0.108783, 1e-11);
  EXPECT_EQ(kTranslation.volts(0.0), 0.0);
  EXPECT_TRUE(std::isnan(kTranslation.volts(kNan)));
}

TEST(VoltageLaw, Equation2) {
  EXPECT_NEAR(kSteering.volts(0.3), -0.0455823, 1e-12);
  EXPECT_NEAR(kSteering.volts(1.0), -0.395030, 1e-12);
  EXPECT_NEAR(kSteering.volts(-0.3), -0.0286926, 1e-12);
  EXPECT_NEAR(kSteering.volts(-1.0), 0.299802, 1e-12);
  EXPECT_EQ(kSteering.volts(0.0), 0.0);
  EXPECT_NEAR(kSteeringCorrected.volts(0.3), -0.2539443, 1e-12);
  EXPECT_NEAR(kSteeringCorrected.volts(-0.3), 0.3102594, 1e-12);
}

TEST(VoltageLaw, SteeringAsPrintedHasTwoAnswersInABand) {
  const struct {
    double volts, positive, negative;
  } table[] = {{-0.169476, 0.54818, 0.0},
               {-0.10, 0.40901, -0.14805},
               {0.0, 0.20869, -0.36114},
               {0.10, 0.00838, -0.57424},
               {0.104181, 0.0, -0.58314}};
  for (const auto& row : table) {
    EXPECT_TRUE(kSteering.ambiguous(row.volts)) << row.volts;
    EXPECT_NEAR(kSteering.positiveRate(row.volts).value(), row.positive, 1e-5) << row.volts;
    EXPECT_NEAR(kSteering.negativeRate(row.volts).value(), row.negative, 1e-5) << row.volts;
  }
  for (const double volts : {-0.17, 0.105}) EXPECT_FALSE(kSteering.ambiguous(volts)) << volts;
}

TEST(VoltageLaw, DeadZonesHaveNoBand) {
  for (int i = -500; i <= 500; ++i) {
    EXPECT_FALSE(kTranslation.ambiguous(i * 1e-3)) << i;
    EXPECT_FALSE(kSteeringCorrected.ambiguous(i * 1e-3)) << i;
  }
}

TEST(VoltageLaw, GainIsRatePerVolt) {
  EXPECT_NEAR(kTranslation.gain(1.0), 0.755276, 1e-6);
  EXPECT_NEAR(kTranslation.gain(-1.0), 0.482232, 1e-6);
}

class RoundTrip : public testing::TestWithParam<k::AxisLaw> {};

TEST_P(RoundTrip, EveryRateComesBackWhenItsSignIsKnown) {
  const k::AxisLaw& law = GetParam();
  const auto check = [&law](double rate) {
    k::AxisInverse inverse(law);
    EXPECT_NEAR(inverse.rate(law.volts(rate), signOf(rate)), rate, 2e-9) << rate;
  };
  for (int i = -20000; i <= 20000; ++i) check(i * 1e-4);
  for (const double tiny : {5e-324, 1e-300, 1e-15, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5}) {
    check(tiny);
    check(-tiny);
  }
}

TEST_P(RoundTrip, ASlowSweepFromOutsideTheBandComesBackWithoutTheSign) {
  const k::AxisLaw& law = GetParam();
  for (const int side : {1, -1}) {
    k::AxisInverse inverse(law);
    for (int i = 20000; i > 0; --i) {
      const double rate = side * i * 1e-4;
      if (law.volts(rate) == 0) continue;  // 0 V is rest
      ASSERT_NEAR(inverse.rate(law.volts(rate)), rate, 2e-9) << rate;
    }
    EXPECT_EQ(inverse.rate(0.0), 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, RoundTrip,
                         testing::Values(kTranslation, kTranslationFigure10, kSteering, kSteeringCorrected));

TEST(AxisInverse, InTheBandTheLastUnambiguousBranchDecides) {
  k::AxisInverse inverse(kSteering);
  EXPECT_NEAR(inverse.rate(-0.1), -0.14805, 1e-5);  // nothing known yet: the smaller rate
  EXPECT_NEAR(inverse.rate(0.05), 0.10853, 1e-5);
  EXPECT_NEAR(inverse.rate(-0.2), 0.60932, 1e-5);  // outside: only a left turn answers
  EXPECT_NEAR(inverse.rate(-0.1), 0.40901, 1e-5);
  EXPECT_NEAR(inverse.rate(0.2), -0.78733, 1e-5);  // outside on the other side
  EXPECT_NEAR(inverse.rate(-0.1), -0.14805, 1e-5);
  EXPECT_EQ(inverse.ambiguousSamples(), 4U);
}

TEST(AxisInverse, TheCommandedSignBeatsMemory) {
  k::AxisInverse inverse(kSteering);
  inverse.rate(-0.2);
  EXPECT_NEAR(inverse.rate(0.05, -1), -0.46769, 1e-5);
  EXPECT_NEAR(inverse.rate(0.05, 1), 0.10853, 1e-5);
  EXPECT_EQ(inverse.rate(0.05, 0), 0.0);
}

TEST(AxisInverse, ADeadZoneIsRestAndNanStaysNan) {
  k::AxisInverse inverse(kTranslation);
  for (const double volts : {-0.1, -0.05, 0.0, 0.05, 0.12}) EXPECT_EQ(inverse.rate(volts), 0.0) << volts;
  EXPECT_TRUE(std::isnan(inverse.rate(kNan)));
  EXPECT_EQ(inverse.ambiguousSamples(), 0U);
}

TEST(AxisLaw, SenselessLawsAreRefused) {
  EXPECT_NO_THROW(k::validate(kSteering));
  for (const k::AxisLaw& law :
       {k::AxisLaw{{0.0, 0.1}, {1.0, -0.1}}, k::AxisLaw{{1.0, 0.1}, {kNan, -0.1}},
        k::AxisLaw{{1.0, kInfinity}, {1.0, -0.1}}, k::AxisLaw{{1.0, 0.1}, {-1.0, -0.1}}}) {
    EXPECT_THROW(k::validate(law), std::invalid_argument);
  }
}

TEST(Unicycle, AQuarterCircleByHand) {
  const k::Pose2D end =
      k::advance({1.0, 2.0, 0.0}, 0.5, 0.5, M_PI);  // radius 1 m, a quarter turn to the left
  EXPECT_NEAR(end.x, 2.0, 1e-12);
  EXPECT_NEAR(end.y, 3.0, 1e-12);
  EXPECT_NEAR(end.theta, M_PI / 2, 1e-12);
}

TEST(Unicycle, AnArcIsTheLimitOfManyEulerSteps) {
  const struct { double v, w; } rates[] = {{0.5, 0.7}, {-0.4, 1.3}, {1.2, -0.2}, {0.0, 1.0}, {0.8, 0.0}};
  for (const auto& [v, w] : rates) {
    constexpr int kSteps = 200000;
    const double dt = 3.0 / kSteps;
    double x = 0.3, y = -0.2, theta = 0.9;
    for (int i = 0; i < kSteps; ++i) {
      x += v * std::cos(theta) * dt;
      y += v * std::sin(theta) * dt;
      theta += w * dt;
    }
    const k::Pose2D end = k::advance({0.3, -0.2, 0.9}, v, w, 3.0);
    EXPECT_NEAR(end.x, x, 3e-5);
    EXPECT_NEAR(end.y, y, 3e-5);
    EXPECT_NEAR(end.theta, theta, 1e-9);
  }
}

TEST(Unicycle, TheArcGoesOverIntoTheStraightLine) {
  const double theta = 0.4, v = 1.0;
  for (int exponent = -3; exponent >= -16; --exponent) {
    // Around the straight line: sideways by v w dt^2 / 2 and short by v w^2 dt^3 / 6, next term of order w^3.
    const double w = std::pow(10.0, exponent);
    const double along = v - v * w * w / 6, aside = v * w / 2;
    const k::Pose2D end = k::advance({0, 0, theta}, v, w, 1.0);
    EXPECT_NEAR(end.x, along * std::cos(theta) - aside * std::sin(theta), w * w * w + 1e-15) << w;
    EXPECT_NEAR(end.y, along * std::sin(theta) + aside * std::cos(theta), w * w * w + 1e-15) << w;
  }
}

TEST(LaserError, Equation4) {
  EXPECT_NEAR(kLaser.mean(1.0), 1.063413, 1e-12);
  EXPECT_NEAR(kLaser.mean(4.0), 4.077174, 1e-12);
  EXPECT_NEAR(kLaser.deviation(0.0), 0.002334, 1e-12);
  EXPECT_NEAR(kLaser.deviation(2.0), 0.002154, 1e-12);
  EXPECT_NEAR(kLaser.deviation(4.0), 0.003566, 1e-12);
  EXPECT_EQ((k::LaserError{1, 0, {-0.001, 0, 0}, 0, 0, 4}.deviation(1.0)), 0.0);
}

TEST(LaserError, BiasThenNoiseThenQuantisation) {
  EXPECT_NEAR(kLaser.reading(1.0, 0.0), 1.063, 1e-12);
  EXPECT_NEAR(kLaser.reading(1.0, 1.0), 1.065, 1e-12);   // 1.063413 + 0.002045
  EXPECT_NEAR(kLaser.reading(1.0, -2.0), 1.059, 1e-12);  // 1.063413 - 0.004090
  k::LaserError continuous = kLaser;
  continuous.resolution = 0;
  EXPECT_NEAR(continuous.reading(1.0, 1.0), 1.065458, 1e-12);
}

TEST(LaserError, TheGateActsOnTheQuantisedReading) {
  EXPECT_NEAR(kLaser.reading(3.92, 0.0), 3.997, 1e-12);
  EXPECT_EQ(kLaser.reading(3.92, 2.0), kInfinity);                               // noise takes it out
  EXPECT_EQ(kLaser.reading(3.93, 0.0), kInfinity);                               // bias does
  EXPECT_NEAR(kLaser.reading((4.0004 - 0.058826) / 1.004587, 0.0), 4.0, 1e-12);  // rounding brings it back
  EXPECT_EQ(kLaser.reading((4.0006 - 0.058826) / 1.004587, 0.0), kInfinity);
  k::LaserError unbiased = kLaser;
  unbiased.scale = 1;
  unbiased.datum_offset = 0;
  EXPECT_TRUE(std::isnan(unbiased.reading(0.0594, 0.0)));
  EXPECT_NEAR(unbiased.reading(0.0596, 0.0), 0.06, 1e-12);
}

TEST(LaserError, NoReturnStaysNoReturn) {
  EXPECT_EQ(kLaser.reading(kInfinity, 0.3), kInfinity);
  EXPECT_TRUE(std::isnan(kLaser.reading(kNan, 0.3)));
}

TEST(LaserError, SenselessErrorsAreRefused) {
  EXPECT_NO_THROW(k::validate(kLaser));
  const auto broken = [](double k::LaserError::*member, double value) {
    k::LaserError error = kLaser;
    error.*member = value;
    EXPECT_THROW(k::validate(error), std::invalid_argument) << value;
  };
  broken(&k::LaserError::scale, 0);
  broken(&k::LaserError::datum_offset, kNan);
  broken(&k::LaserError::resolution, -0.001);
  broken(&k::LaserError::range_min, -0.1);
  broken(&k::LaserError::range_max, 0.06);
}

}  // namespace test_model
