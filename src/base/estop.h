// SPDX-License-Identifier: BSD-3-Clause
// The emergency stop: latched, and released by nothing but a reset. No ROS: time is an argument.
#pragma once

#include <optional>
#include <string>

#include "base/words.h"

namespace kurumaisu {

/// Latches when anybody presses it and, with a timeout, when anybody who watches over it falls silent.
class EStop {
 public:
  /// timeout [s] after which silence is a stop; 0: it never is.
  explicit EStop(double timeout) : timeout_(timeout) {}

  /// Somebody who watches says at time t [s] whether there is a cause to stop.
  void hear(const Speaker& by, bool stop, double t);

  /// Stops without a cause that lasts.
  void press() { latched_ = true; }

  /// Goes on to time t [s]. Time that runs backwards makes everything heard unheard, but keeps a stop.
  void tick(double t);

  /// Whether the chair must be neutral: latched, or nobody has yet said that all is well.
  bool stopped() const { return latched_ || waiting(); }
  bool latched() const { return latched_; }

  /// Releases the latch, or says why not. Who pressed it and is gone does not keep it. moving: whether somebody commands
  /// more than rest.
  std::string reset(bool moving);

 private:
  bool waiting() const { return timeout_ > 0 && !words_.oldest(); }

  double timeout_;
  bool latched_ = false;
  Words words_;
  bool silent_ = false;          ///< for longer than the timeout, at the last tick
  std::optional<double> since_;  ///< when the wait for the first word began [s]
  std::optional<double> now_;    ///< the last tick [s]
};

}  // namespace kurumaisu
