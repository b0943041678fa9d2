// SPDX-License-Identifier: BSD-3-Clause
// A D/A converter that may go away and come back.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "dac/converter.h"

namespace kurumaisu::guard {

/// Pauses between attempts to open the device: the first one, doubled up to the longest [s].
struct BackOff {
  double first;
  double longest;
};

/// What must be held in place of motion. A converter that holds something else is not neutral, and so as good as lost.
struct Neutral {
  double reference;            ///< [V]
  double reference_tolerance;  ///< [V]
  double tolerance;            ///< [V] of the other two, from 0
};

/// The converter, opened when it can be. Neutral is the first thing that it is given after each opening.
class Device {
 public:
  using Open = std::function<std::unique_ptr<dac::Converter>()>;

  Device(Open open, const Neutral& neutral, BackOff back_off);

  /// Puts out, and says whether the device now holds it. If not, see problem(), and the device is lost.
  bool put(const dac::Volts& volts, double now);

  /// The next step to a device that holds neutral: neutral over the line that failed, then opening, then what the device
  /// must be told first, for as long as it boots, then neutral over the new line. True if it is there. One step at a
  /// time, for each may take as long as the device's timeouts are.
  bool recover(double now);

  bool isLost() const { return lost_; }
  double retryAt() const { return retry_at_; }  ///< [s] not to be recovered before

  const dac::Volts& held() const { return held_; }  ///< what it was last known to hold
  const std::string& problem() const { return problem_; }
  std::string name() const { return converter_ ? converter_->name() : "no device yet"; }

 private:
  void hold(const dac::Volts& volts);

  Open open_;
  Neutral neutral_;
  BackOff back_off_;
  std::unique_ptr<dac::Converter> converter_;
  dac::Volts held_;
  bool lost_ = true;
  bool is_open_ = false;   ///< there is a line to try
  bool is_ready_ = false;  ///< the device at its end takes voltages
  double retry_at_ = 0;
  double pause_;
  std::string problem_;
};

}  // namespace kurumaisu::guard
