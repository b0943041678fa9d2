// SPDX-License-Identifier: BSD-3-Clause
#include "model/voltage_law.h"

#include <cmath>
#include <stdexcept>

namespace kurumaisu {
namespace {

// A rate this small [m/s, rad/s] of the wrong sign is rounding of (slope * rate + intercept), not another
// branch: without it the voltage of a tiny turn could be read as the full turn of the opposite side.
constexpr double kRounding = 1e-9;

double rateOn(const Branch& branch, double volts) { return (volts - branch.intercept) / branch.slope; }

int signOf(double value) { return (value > 0) - (value < 0); }

}  // namespace

double AxisLaw::volts(double rate) const {
  if (rate > 0) return positive.slope * rate + positive.intercept;
  if (rate < 0) return negative.slope * rate + negative.intercept;
  return rate;  // 0 stays 0, NaN stays NaN
}

std::optional<double> AxisLaw::positiveRate(double volts) const {
  const double rate = rateOn(positive, volts);
  if (rate < -kRounding) return std::nullopt;
  return std::fmax(rate, 0.0);
}

std::optional<double> AxisLaw::negativeRate(double volts) const {
  const double rate = rateOn(negative, volts);
  if (rate > kRounding) return std::nullopt;
  return std::fmin(rate, 0.0);
}

bool AxisLaw::ambiguous(double volts) const {
  return positiveRate(volts).has_value() && negativeRate(volts).has_value();
}

void validate(const AxisLaw& law) {
  for (const Branch& branch : {law.positive, law.negative}) {
    if (!std::isfinite(branch.slope) || !std::isfinite(branch.intercept) || branch.slope == 0) {
      throw std::invalid_argument("slope and intercept must be finite and the slope not 0");
    }
  }
  if ((law.positive.slope > 0) != (law.negative.slope > 0)) {
    throw std::invalid_argument("the slopes of both branches must have the same sign");
  }
}

double AxisInverse::rate(double volts, std::optional<int> commanded_sign) {
  if (std::isnan(volts)) return volts;
  if (volts == 0) return 0.0;
  const auto positive = law_.positiveRate(volts);
  const auto negative = law_.negativeRate(volts);
  if (positive && negative) {
    ++memory_.ambiguous_samples;
    return choose(*positive, *negative, commanded_sign);
  }
  const double rate = positive.value_or(negative.value_or(0.0));
  if (rate != 0) memory_.last_sign = signOf(rate);
  return rate;
}

double AxisInverse::choose(double positive, double negative, std::optional<int> commanded_sign) const {
  const int sign = commanded_sign.value_or(memory_.last_sign);
  if (sign > 0) return positive;
  if (sign < 0) return negative;
  if (commanded_sign) return 0.0;  // rest is commanded
  return positive <= -negative ? positive : negative;
}

}  // namespace kurumaisu
