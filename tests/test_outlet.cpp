// SPDX-License-Identifier: BSD-3-Clause
// Voltages: bands, codes, knob, what they stand for, and which laws are refused.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "base/outlet.h"

namespace test_outlet {

namespace k = kurumaisu;

namespace {

const k::AxisLaw kTranslation{{1.32402, 0.127906}, {2.07369, -0.108783}};
const k::AxisLaw kPrinted{{-0.499211, 0.104181}, {-0.469278, -0.169476}};
const k::AxisLaw kCorrected{{-0.499211, -0.104181}, {-0.469278, 0.169476}};

template <typename Action>
std::string complaint(Action action) {
  try {
    action();
  } catch (const std::invalid_argument& problem) {
    return problem.what();
  }
  return "";
}

}  // namespace

TEST(Channel, RoundsToCodesHalvesToTheEvenOne) {
  const k::Channel channel{-1.0, 1.1, 0.25};
  EXPECT_EQ(channel.nearest(0.3, 1), 0.25);
  EXPECT_EQ(channel.nearest(0.125, 1), 0.0);
  EXPECT_EQ(channel.nearest(0.375, 1), 0.5);
  EXPECT_EQ(channel.nearest(-0.375, 1), -0.5);
  EXPECT_EQ(channel.nearest(9, 1), 1.0);  // the highest code within 1.1 V
  EXPECT_EQ(channel.nearest(-9, 1), -1.0);
  EXPECT_EQ(channel.nearest(9, 0.5), 0.5);  // a knob at half: 0.55 V
}

TEST(Channel, NeverLeavesItsBand) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<> uniform(0.01, 3);
  for (int i = 0; i < 100000; ++i) {
    const double knob = uniform(random) / 3;
    const k::Channel channel{-uniform(random), uniform(random), i % 2 ? 0.3 * uniform(random) : 0.0};
    const double wish = 4 * (uniform(random) - 1.5), got = channel.nearest(wish, knob);
    ASSERT_GE(got, knob * channel.min * (1 + 1e-12));
    ASSERT_LE(got, knob * channel.max * (1 + 1e-12));
    if (wish > knob * channel.min && wish < knob * channel.max && channel.resolution == 0) {
      ASSERT_EQ(got, wish);
    }
  }
}

TEST(Outlet, RatesAreWhatTheVoltagesStandFor) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<> uniform(-2, 2);
  for (const k::AxisLaw& steering : {kPrinted, kCorrected}) {
    k::Outlet outlet({{kTranslation, steering}, {-1.5, 1.5, 0.01}, {-0.6, 0.6, 0.01}, 0.9, 2.5});
    for (int i = 0; i < 10000; ++i) {
      const double v = uniform(random), w = uniform(random);
      const k::Output output = outlet.at(v, w);
      // By the branch of the sign commanded, or rest: in the dead zone, and at 0 V whatever the law.
      const auto stands = [](const k::AxisLaw& law, double volts, double rate) {
        const k::Branch branch = rate > 0 ? law.positive : law.negative;
        const double found = (volts - branch.intercept) / branch.slope;
        return volts == 0 || found * rate < 0 ? 0 : found;
      };
      ASSERT_NEAR(output.v, stands(kTranslation, output.translation, v), 1e-9) << v;
      ASSERT_NEAR(output.w, stands(steering, output.steering, w), 1e-9) << w;
      ASSERT_LE(std::abs(output.w), std::abs(w) + 0.01 / 0.46) << w;  // a code further at most
      ASSERT_LE(std::abs(output.translation), 0.9 * 1.5);
      ASSERT_NEAR(std::remainder(output.steering, 0.01), 0, 1e-9);
    }
  }
}

TEST(Outlet, WithoutCodesAndWithinTheBandNothingChangesToTheLastBit) {
  k::Outlet outlet({{kTranslation, kPrinted}, {-3, 3, 0}, {-3, 3, 0}, 1.0, 2.5});
  std::mt19937_64 random(5);
  std::uniform_real_distribution<> uniform(-1, 1);
  for (int i = 0; i < 10000; ++i) {
    const double v = uniform(random), w = uniform(random);
    const k::Output output = outlet.at(v, w);
    ASSERT_EQ(output.v, v);
    ASSERT_EQ(output.w, w);
  }
  EXPECT_EQ(outlet.at(0, 0).steering, 0.0);
  EXPECT_EQ(outlet.counts().clamped, 0U);
}

TEST(Outlet, CodesInTheDeadZoneAreRest) {
  k::Outlet outlet({{kTranslation, kCorrected}, {-3, 3, 0.1}, {-3, 3, 0.1}, 1.0, 2.5});
  const k::Output output = outlet.at(0.001, 0.0);
  EXPECT_NEAR(output.translation, 0.1, 1e-12);  // below 0.127906 V
  EXPECT_EQ(output.v, 0.0);
}

TEST(Band, OnlyOverlappingBranchesMakeOne) {
  EXPECT_FALSE(k::ambiguousBand(kCorrected));
  EXPECT_FALSE(k::ambiguousBand({{1.0, 0.0}, {1.0, 0.0}}));
  const auto rising = k::ambiguousBand({{1.0, -0.2}, {1.0, 0.3}});
  ASSERT_TRUE(rising);
  EXPECT_EQ(rising->low, -0.2);
  EXPECT_EQ(rising->high, 0.3);
}

TEST(Band, AgreesWithTheLawItself) {
  const auto band = k::ambiguousBand(kPrinted);
  ASSERT_TRUE(band);
  for (int i = -400; i <= 400; ++i) {
    if (i == 0) continue;  // 0 V is rest
    EXPECT_EQ(band->contains(i * 1e-3), kPrinted.ambiguous(i * 1e-3)) << i;
  }
}

// Fault 10
TEST(Validation, AcceptsWhatSamplesShowToBeMonotonicAndNothingElse) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<> uniform(-1, 1);
  int accepted = 0;
  for (int i = 0; i < 20000; ++i) {
    const double sign = random() % 2 ? 1 : -1;
    const k::AxisLaw law{{sign * (1.01 + uniform(random)), uniform(random)},
                         {sign * (1.01 + uniform(random)), uniform(random)}};
    bool monotonic = true;
    double last = sign * law.volts(-1e-6);
    for (const double rate : {0.0, 1e-6, 1.0}) {
      monotonic &= sign * law.volts(rate) >= last - 1e-5;
      last = sign * law.volts(rate);
    }
    const bool refused = !complaint([&law] { k::validateMonotonic(law); }).empty();
    const double nearest = std::min(std::abs(law.positive.intercept), std::abs(law.negative.intercept));
    if (nearest < 1e-4) continue;  // too close to tell by samples
    ASSERT_EQ(refused, !monotonic) << law.positive.intercept << " " << law.negative.intercept << " " << sign;
    accepted += !refused;
  }
  EXPECT_GT(accepted, 1000);
}

TEST(Validation, SaysWhatIsWrong) {
  k::validateMonotonic(kTranslation);
  k::validateMonotonic(kCorrected);
  EXPECT_EQ(complaint([] { k::validateMonotonic(kPrinted); }),
            "is not monotonic: its branches overlap from -0.169476 to 0.104181 V");
  EXPECT_EQ(complaint([] {
              k::validateMonotonic({{1, 0.3}, {1, 0.1}});
            }),
            "is not monotonic: neutral, 0 V, lies outside its dead zone, 0.1 to 0.3 V");
  const auto refused = [](const k::Channel& channel, double knob) {
    return complaint([&] { k::validate(kTranslation, channel, knob); });
  };
  EXPECT_EQ(refused({-2, 2, 0.005}, 1), "");
  EXPECT_EQ(refused({0.1, 2, 0}, 1), "neutral, 0 V, must lie inside its band: min 0.1, max 2");
  EXPECT_EQ(refused({-2, 0.2, 0.5}, 1), "resolution must leave a code on either side of neutral: 0.5");
  EXPECT_EQ(refused({-2, 0.2, 0}, 0.5),
            "the band (-1, 0.1) V does not reach beyond the law's intercept 0.127906 V");
}

}  // namespace test_outlet
