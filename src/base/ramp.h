// SPDX-License-Identifier: BSD-3-Clause
// One rate on its way to a target: bounded acceleration, deceleration and jerk, in the least time. No ROS.
#pragma once

namespace kurumaisu {

/// Per axis, in m or rad; all positive.
struct RampLimits {
  double acceleration;  ///< away from rest [1/s^2]
  double deceleration;  ///< towards rest [1/s^2]
  double jerk;          ///< change of either [1/s^3]
};

/// The rate and its slope run along the time-optimal curve in continuous time; samples are points of it.
///
/// So differences of samples keep the bounds whatever the intervals between them and whenever the target
/// changes: the first divided difference is a mean of the slope, the second one of the jerk.
class Ramp {
 public:
  explicit Ramp(const RampLimits& limits) : limits_(limits) {}

  /// Goes on towards a target for dt [s], at least 0. Without overshoot.
  void advance(double target, double dt);

  /// Goes on from another rate of the caller's own making, steadily: slope 0. Not bound by the limits.
  void put(double rate);

  /// Other limits from here on: the rate does not jump, nor does it overshoot what it would have come to.
  void configure(const RampLimits& limits);

  double rate() const { return rate_; }

  /// The largest magnitude between here and where it comes to rest when it heads for nothing any more.
  double reach() const;

 private:
  struct Phase {
    double jerk;
    double seconds;
    double slope;  ///< at the end, exactly
    double rate;   ///< at the end, exactly; NaN: as it comes out
  };

  double rest() const;
  double limitOf(double rate, double slope) const;
  double aim(double target) const;
  Phase next(double target) const;
  Phase rise(double target, double rate, double slope) const;
  void follow(const Phase& phase, double seconds);
  void keepCrossing();

  RampLimits limits_;
  double rate_ = 0;
  double slope_ = 0;  ///< of the rate [1/s^2]
};

}  // namespace kurumaisu
