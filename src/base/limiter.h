// SPDX-License-Identifier: BSD-3-Clause
// What a command may do to the person in the chair: rates, their ramps, and both together. No ROS.
#pragma once

#include <limits>

#include "base/ramp.h"

namespace kurumaisu {

/// Forward speed [m/s] and yaw rate [rad/s].
struct Rates {
  double v = 0;
  double w = 0;
  bool zero() const { return v == 0 && w == 0; }
};

/// All numbers positive.
struct Limits {
  double v_forward;             ///< [m/s]
  double v_reverse;             ///< [m/s]
  double w;                     ///< to either side [rad/s]
  RampLimits v_ramp;            ///< [m/s^2, m/s^3]
  RampLimits w_ramp;            ///< [rad/s^2, rad/s^3]
  double lateral_acceleration;  ///< |v w| [m/s^2]
  bool keep_curvature;          ///< whether v and w of a command beyond a limit shrink together
};

/// The command as far as the limits on rates let it pass. A cap [m/s] bounds v, and w in the same proportion
/// to its limit: with cap 0 the chair does not turn either.
Rates shaped(const Limits& limits, const Rates& command, double cap);

/// Leads both rates from command to command. For samples of advance(): |dv/dt|, |d2v/dt2|, the same of w, and
/// |v w| keep their limits at each sample and between any three, whatever the commands.
class Limiter {
 public:
  static constexpr double kNoCap = std::numeric_limits<double>::infinity();

  explicit Limiter(const Limits& limits);

  /// Other limits from here on; the rates go to them by the ramps.
  void configure(const Limits& limits);

  /// One step of dt [s] towards a command under a cap [m/s].
  Rates advance(const Rates& command, double cap, double dt);

  /// One step of dt [s] to rest at full deceleration, without regard to jerk: a fault does not wait for comfort.
  /// At rest after v / deceleration, or with the curvature kept, when the slower of both axes is.
  Rates brake(double dt);

  /// Rest, at once.
  void reset();

  Rates rates() const { return {v_.rate(), w_.rate()}; }
  const Limits& limits() const { return limits_; }

 private:
  Limits limits_;
  Ramp v_;
  Ramp w_;
};

}  // namespace kurumaisu
