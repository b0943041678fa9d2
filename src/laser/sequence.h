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
  /// Scans missing before the one of a clock [ms] that came at a host's time [s], if one is due each period [s].
  std::uint64_t missing(std::uint32_t clock, double host, double period) {
    const std::optional<Place> before = std::exchange(last_, Place{clock, host});
    if (!before) return 0;
    const double passed = 1e-3 * ((clock - before->clock) & kMask);
    const double here = host - before->host;
    if (std::abs(passed - here) > kApart + kDrift * here) return 0;  // it was reset, or a clock was set
    return static_cast<std::uint64_t>(std::max(std::lround(passed / period) - 1, 0L));
  }

  void reset() { last_.reset(); }

 private:
  struct Place {
    std::uint32_t clock;
    double host;
  };

  static constexpr std::uint32_t kMask = (1U << 24U) - 1;
  static constexpr double kApart = 1.0;   // [s] that no scan comes late
  static constexpr double kDrift = 0.01;  // of the sensor's clock, at most

  std::optional<Place> last_;
};

}  // namespace kurumaisu::laser
