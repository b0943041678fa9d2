// SPDX-License-Identifier: BSD-3-Clause
// Which scans are missing, by the sensor's clock.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

namespace kurumaisu::laser {

class Sequence {
 public:
  /// Does a clock [ms] that comes at a host's time [s] go on where the last one was?
  bool continues(std::uint32_t clock, double host) const {
    return !last_ || isNear(*last_, clock, host, kPunctual);
  }

  /// Scans missing before the one of a clock [ms] that came at a host's time [s], if one is due each period [s].
  std::uint64_t missing(std::uint32_t clock, double host, double period) {
    const std::optional<Place> before = std::exchange(last_, Place{clock, host});
    if (!before) return 0;
    if (!isNear(*before, clock, host, kApart)) return 0;  // it was reset, or a clock was set
    return static_cast<std::uint64_t>(std::max(std::lround(passed(*before, clock) / period) - 1, 0L));
  }

  void reset() { last_.reset(); }

 private:
  struct Place {
    std::uint32_t clock;
    double host;
  };

  /// [s] by the sensor's clock.
  static double passed(const Place& before, std::uint32_t clock) {
    return 1e-3 * ((clock - before.clock) & kMask);
  }

  static bool isNear(const Place& before, std::uint32_t clock, double host, double apart) {
    const double here = host - before.host;
    return std::abs(passed(before, clock) - here) <= apart + kDrift * std::abs(here);
  }

  static constexpr std::uint32_t kMask = (1U << 24U) - 1;
  static constexpr double kPunctual = 0.05;  // [s] that few scans come late
  static constexpr double kApart = 1.0;      // [s] that no scan comes late
  static constexpr double kDrift = 0.01;     // of the sensor's clock, at most

  std::optional<Place> last_;
};

}  // namespace kurumaisu::laser
