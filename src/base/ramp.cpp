// SPDX-License-Identifier: BSD-3-Clause
#include "base/ramp.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kurumaisu {
namespace {

constexpr double kRampRounding = 1e-12;  // of rates [m/s, rad/s] and, as a share, of slopes
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kMostPhases =
    32;  // a way has at most seven, and two more through rest; against an endless loop

/// Time [s] until the rate is 0, rising to it from below with this slope and jerk; infinite if it never is.
double untilZero(double rate, double slope, double jerk) {
  const double square = slope * slope - 2 * jerk * rate;
  if (!(rate < 0) || !(slope > 0) || square < 0) return std::numeric_limits<double>::infinity();
  return -2 * rate / (slope + std::sqrt(square));
}

}  // namespace

/// Rate that it comes to when its slope goes to 0 at once. It stays the same on the way there.
double Ramp::rest() const { return rate_ + slope_ * std::abs(slope_) / (2 * limits_.jerk); }

double Ramp::reach() const { return std::max(std::abs(rate_), std::abs(rest())); }

/// Bound of a slope of this sign at this rate. At rest every slope leads away from rest.
double Ramp::limitOf(double rate, double slope) const {
  return rate * slope < 0 ? limits_.deceleration : limits_.acceleration;
}

/// What to head for on this side of rest: when deceleration may be harder than acceleration, the slope must
/// have come down to the latter by the time that the rate changes its sign.
double Ramp::aim(double target) const {
  if (!(rate_ * target < 0) || limits_.deceleration <= limits_.acceleration) return target;
  const double most = limits_.acceleration * limits_.acceleration / (2 * limits_.jerk);
  return std::clamp(target, -most, most);
}

void Ramp::advance(double target, double dt) {
  for (int i = 0; i < kMostPhases && dt > 0; ++i) {
    if (rate_ == target && slope_ == 0) return;
    const Phase phase = next(target);
    follow(phase, std::min(dt, phase.seconds));
    dt -= phase.seconds;
  }
}

/// The part of the way up to the next change of the jerk, or through rest.
Ramp::Phase Ramp::next(double target) const {
  const double goal = aim(target);
  const double missing = goal - rest();
  const double scale = 1 + std::abs(goal) + std::abs(rate_) + std::abs(rest());
  if (std::abs(missing) <= kRampRounding * scale) {  // on the last curve: the slope goes to 0
    const double jerk = std::copysign(limits_.jerk, -slope_);
    Phase landing{jerk, std::abs(slope_) / limits_.jerk, 0, goal};
    const double zero =
        goal == target ? landing.seconds : untilZero(-std::abs(rate_), std::abs(slope_), -limits_.jerk);
    if (zero < landing.seconds) landing = {jerk, zero, slope_ + jerk * zero, 0};
    return landing;
  }
  if (missing > 0) return rise(goal, rate_, slope_);
  const Phase mirrored = rise(-goal, -rate_, -slope_);
  return {-mirrored.jerk, mirrored.seconds, -mirrored.slope, -mirrored.rate};
}

/// To a goal above what it would come to.
Ramp::Phase Ramp::rise(double goal, double rate, double slope) const {
  const double most = rate < 0 ? limits_.deceleration : limits_.acceleration;
  const double jerk = limits_.jerk;
  Phase phase{jerk, -slope / jerk, 0, kNan};
  if (slope >= most * (1 - kRampRounding) && slope <= most * (1 + kRampRounding)) {
    const double missing = goal - rate - slope * slope / (2 * jerk);
    phase = {0, missing / slope, slope, kNan};
  } else if (slope > most) {
    phase = {-jerk, (slope - most) / jerk, most, kNan};
  } else if (slope >= 0) {
    const double peak = std::sqrt(std::max(0.0, jerk * (goal - rate) + slope * slope / 2));
    const double top = std::max(slope, std::min(peak, most));
    phase = {jerk, (top - slope) / jerk, top, kNan};
  }
  const double zero = untilZero(rate, slope, phase.jerk);
  return zero < phase.seconds ? Phase{phase.jerk, zero, slope + phase.jerk * zero, 0} : phase;
}

void Ramp::follow(const Phase& phase, double seconds) {
  rate_ += seconds * (slope_ + 0.5 * phase.jerk * seconds);
  slope_ += phase.jerk * seconds;
  if (seconds < phase.seconds) return;
  slope_ = phase.slope;
  if (!std::isnan(phase.rate)) rate_ = phase.rate;
}

void Ramp::put(double rate) {
  rate_ = rate;
  slope_ = 0;
}

void Ramp::configure(const RampLimits& limits) {
  if (limits.jerk < limits_.jerk) slope_ *= std::sqrt(limits.jerk / limits_.jerk);  // the same rest()
  limits_ = limits;
  const double most = limitOf(rate_, slope_);
  slope_ = std::clamp(slope_, -most, most);
  keepCrossing();
}

/// Takes from a slope towards rest what would be too much beyond it.
void Ramp::keepCrossing() {
  if (!(rate_ * slope_ < 0)) return;
  const double acceleration = limits_.acceleration;
  const double most = std::sqrt(2 * limits_.jerk * std::abs(rate_) + acceleration * acceleration);
  slope_ = std::clamp(slope_, -most, most);
}

}  // namespace kurumaisu
