// SPDX-License-Identifier: BSD-3-Clause
// How fast others let the chair go: whoever watches the laser, a slope, a crowd. No ROS: time is an argument.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <string>

namespace kurumaisu {

struct SpeedCapSettings {
  double timeout;   ///< a cap older than this is none [s]
  double fallback;  ///< the cap then [m/s]
};

class SpeedCap {
 public:
  explicit SpeedCap(const SpeedCapSettings& settings) : settings_(settings) {}

  /// Takes a cap [m/s] of a publisher at time t [s]. Infinity is no cap; one that is NaN or negative is not understood
  /// (false): then the chair must not go at all.
  bool hear(const std::string& publisher, double cap, double t) {
    const bool is_understood = cap >= 0;
    ++counts_.heard;
    if (!is_understood) ++counts_.refused;
    heard_[publisher] = {is_understood ? cap : 0, t};
    return is_understood;
  }

  /// The lowest cap at time t [s]; heard in the future, before the clock ran backwards, it is none.
  double at(double t) {
    double lowest = std::numeric_limits<double>::infinity();
    for (auto it = heard_.begin(); it != heard_.end();) {
      const bool is_old = t < it->second.t || t - it->second.t > settings_.timeout;
      if (!is_old) lowest = std::min(lowest, it->second.cap);
      it = is_old ? heard_.erase(it) : std::next(it);
    }
    return heard_.empty() ? settings_.fallback : lowest;
  }

  struct Counts {
    std::uint64_t heard = 0;
    std::uint64_t refused = 0;  ///< of those, not understood
  };
  const Counts& counts() const { return counts_; }

 private:
  struct Heard {
    double cap;
    double t;
  };

  SpeedCapSettings settings_;
  Counts counts_;
  std::map<std::string, Heard> heard_;  ///< by publisher
};

}  // namespace kurumaisu
