// SPDX-License-Identifier: BSD-3-Clause
// How scan_listener and stock_urg print a scan, for scripts/bench laser and faults:
//   scan TOPIC ARRIVAL NOW STAMP RANGE BEAMS OTHERS CODES NANS INFS
// ARRIVAL is [s] of the monotonic clock, NOW and STAMP [s] of the host's, RANGE the median [mm] of what was measured, OTHERS
// how many measured beams are not at the median, CODES how many are below 20 mm, where the sensor's error codes lie.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

class ScanLine {
 public:
  /// Heard now.
  explicit ScanLine(std::string topic) : topic_(std::move(topic)) {}

  /// A beam's range [m]: NaN or infinite, too.
  void add(double range) {
    constexpr double kCodes = 0.02;  // [m]
    ++beams_;
    if (std::isnan(range)) {
      ++nans_;
    } else if (std::isinf(range)) {
      ++infs_;
    } else if (range < kCodes) {
      ++codes_;
    } else {
      measured_.push_back(std::lround(1000 * range));
    }
  }

  void print(double stamp) const {
    const long middle = median();
    const auto same = std::count(measured_.begin(), measured_.end(), middle);
    std::printf("scan %s %.6f %.6f %.6f %ld %ld %zd %ld %ld %ld\n", topic_.c_str(), arrival_, now_, stamp,
                middle, beams_, static_cast<std::ptrdiff_t>(measured_.size()) - same, codes_, nans_, infs_);
    std::fflush(stdout);
  }

 private:
  template <typename Clock>
  static double seconds() {
    return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
  }

  long median() const {
    if (measured_.empty()) return 0;
    std::vector<long> sorted = measured_;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    return *middle;
  }

  std::string topic_;
  double arrival_ = seconds<std::chrono::steady_clock>();
  double now_ = seconds<std::chrono::system_clock>();
  std::vector<long> measured_;  // [mm]
  long beams_ = 0, codes_ = 0, nans_ = 0, infs_ = 0;
};
