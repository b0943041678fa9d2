// SPDX-License-Identifier: BSD-3-Clause
// The emergency stop: latched, and released by nothing but a reset. No ROS: time is an argument.
#pragma once

#include <optional>
#include <string>

namespace kurumaisu {

/// Latches when it is pressed and, with a timeout, when whoever watches over it falls silent.
class EStop {
 public:
  /// timeout [s] after which silence is a stop; 0: it never is.
  explicit EStop(double timeout) : timeout_(timeout) {}

  /// Whoever watches says at time t [s] whether there is a cause to stop.
  void hear(bool stop, double t);

  /// Stops without a cause that lasts.
  void press() { latched_ = true; }

  /// Goes on to time t [s]. Time that runs backwards makes everything heard unheard, but keeps a stop.
  void tick(double t);

  /// Whether the chair must be neutral: latched, or nobody has yet said that all is well.
  bool stopped() const { return latched_ || waiting(); }
  bool latched() const { return latched_; }

  /// Releases the latch, or says why not. moving: whether somebody commands more than rest.
  std::string reset(bool moving);

 private:
  bool waiting() const { return timeout_ > 0 && !heard_; }

  double timeout_;
  bool latched_ = false;
  bool cause_ = false;           ///< what was said last
  bool silent_ = false;          ///< for longer than the timeout, at the last tick
  std::optional<double> heard_;  ///< when [s]
  std::optional<double> since_;  ///< when the wait for the first word began [s]
  std::optional<double> now_;    ///< the last tick [s]
};

}  // namespace kurumaisu
