// SPDX-License-Identifier: BSD-3-Clause
// How fast others let the chair go: whoever watches the laser, a slope, a crowd. No ROS: time is an argument.
#pragma once

#include <cstdint>
#include <optional>

namespace kurumaisu {

struct SpeedCapSettings {
  double timeout;   ///< a cap older than this is none [s]
  double fallback;  ///< the cap then [m/s]
};

class SpeedCap {
 public:
  explicit SpeedCap(const SpeedCapSettings& settings) : settings_(settings) {}

  /// Takes a cap [m/s] at time t [s]; refuses (false) one that is NaN or negative. Infinity is no cap.
  bool hear(double cap, double t) {
    ++counts_.heard;
    if (!(cap >= 0)) {
      ++counts_.refused;
      return false;
    }
    heard_ = {cap, t};
    return true;
  }

  /// The cap at time t [s]; heard in the future, before the clock ran backwards, it is none.
  double at(double t) {
    if (heard_ && (t < heard_->t || t - heard_->t > settings_.timeout)) heard_.reset();
    return heard_ ? heard_->cap : settings_.fallback;
  }

  struct Counts {
    std::uint64_t heard = 0;
    std::uint64_t refused = 0;  ///< of those
  };
  const Counts& counts() const { return counts_; }

 private:
  struct Heard {
    double cap;
    double t;
  };

  SpeedCapSettings settings_;
  Counts counts_;
  std::optional<Heard> heard_;
};

}  // namespace kurumaisu
