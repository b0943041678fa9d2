// SPDX-License-Identifier: BSD-3-Clause
#include "base/outlet.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace kurumaisu {
namespace {

template <typename... Parts>
std::invalid_argument refusal(const Parts&... parts) {
  std::ostringstream out;
  (out << ... << parts);
  return std::invalid_argument(out.str());
}

bool isIn(const std::optional<Band>& band, double volts) { return band && band->contains(volts); }

/// The rate that a voltage stands for which is to stand for this one.
double standsFor(const AxisLaw& law, AxisInverse& inverse, double volts, double rate) {
  if (volts == law.volts(rate)) return rate;  // to the last bit
  return inverse.rate(volts, (rate > 0) - (rate < 0));
}

/// The voltage to put out for a rate. Where branches overlap, rounding may step over the end of the rate's own,
/// to where only the opposite rate answers: then it is the next code on its own branch, or rest.
double voltsFor(const AxisLaw& law, const Channel& channel, double knob, double rate) {
  const double volts = channel.nearest(law.volts(rate), knob);
  if (rate == 0) return volts;
  const auto opposite = rate > 0 ? law.negativeRate(volts) : law.positiveRate(volts);
  const auto own = rate > 0 ? law.positiveRate(volts) : law.negativeRate(volts);
  if (own || !opposite) return volts;
  const double next = volts + std::copysign(channel.resolution, rate * law.positive.slope);
  return next == channel.nearest(next, knob) ? next : 0;
}

}  // namespace

std::optional<Band> ambiguousBand(const AxisLaw& law) {
  // A branch reaches from its intercept to infinity, on the side that its slope and its sign of the rate
  // give.
  const bool rising = law.positive.slope > 0;
  const Band band{rising ? law.positive.intercept : law.negative.intercept,
                  rising ? law.negative.intercept : law.positive.intercept};
  return band.low < band.high ? std::optional(band) : std::nullopt;
}

double Channel::nearest(double volts, double knob) const {
  if (resolution == 0) return std::clamp(volts, knob * min, knob * max);
  const double lowest = std::ceil(knob * min / resolution);
  const double highest = std::floor(knob * max / resolution);
  return resolution * std::clamp(std::nearbyint(volts / resolution), lowest, highest);
}

void validate(const AxisLaw& law, const Channel& channel, double knob) {
  if (!(channel.min < 0) || !(channel.max > 0)) {
    throw refusal("neutral, 0 V, must lie inside its band: min ", channel.min, ", max ", channel.max);
  }
  const double low = knob * channel.min;
  const double high = knob * channel.max;
  if (channel.resolution > std::min(-low, high)) {
    throw refusal("resolution must leave a code on either side of neutral: ", channel.resolution);
  }
  for (const Branch& branch : {law.positive, law.negative}) {
    if (branch.intercept > low && branch.intercept < high) continue;
    throw refusal("the band (", low, ", ", high, ") V does not reach beyond the law's intercept ",
                  branch.intercept, " V");
  }
}

void validateMonotonic(const AxisLaw& law) {
  const double sign = law.positive.slope > 0 ? 1 : -1;
  const double above = sign * law.positive.intercept;
  const double below = sign * law.negative.intercept;
  if (above < below) {
    throw refusal("is not monotonic: its branches overlap from ", std::min(sign * above, sign * below),
                  " to ", std::max(sign * above, sign * below), " V");
  }
  if (above < 0 || below > 0) {
    throw refusal("is not monotonic: neutral, 0 V, lies outside its dead zone, ",
                  std::min(sign * above, sign * below), " to ", std::max(sign * above, sign * below), " V");
  }
}

Outlet::Outlet(const OutletSettings& settings)
    : settings_(settings),
      translation_band_(ambiguousBand(settings.law.translation)),
      steering_band_(ambiguousBand(settings.law.steering)),
      translation_inverse_(settings.law.translation),
      steering_inverse_(settings.law.steering) {}

Output Outlet::at(double v, double w) {
  const VoltageLaw& law = settings_.law;
  const double wanted[] = {law.translation.volts(v), law.steering.volts(w)};
  const double volts[] = {voltsFor(law.translation, settings_.translation, settings_.knob, v),
                          voltsFor(law.steering, settings_.steering, settings_.knob, w)};
  ++counts_.samples;
  if (isIn(translation_band_, volts[0]) || isIn(steering_band_, volts[1])) ++counts_.ambiguous;
  const auto beyond = [this](const Channel& channel, double wish) {
    return wish < settings_.knob * channel.min || wish > settings_.knob * channel.max;
  };
  if (beyond(settings_.translation, wanted[0]) || beyond(settings_.steering, wanted[1])) ++counts_.clamped;
  return {volts[0], volts[1], settings_.reference_voltage,
          standsFor(law.translation, translation_inverse_, volts[0], v),
          standsFor(law.steering, steering_inverse_, volts[1], w)};
}

}  // namespace kurumaisu
