// SPDX-License-Identifier: BSD-3-Clause
// The line below noise that only adds.
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

namespace kurumaisu::laser {

/// A value at a time.
struct Point {
  double x = 0;  ///< [s]
  double y = 0;  ///< [s]
};

/// The highest line below the points of the last while (Moon, Skelly, Towsley: Estimation and Removal of Clock Skew from
/// Network Delay Measurements, 1999), from the lowest point of each second, which bounds time and memory.
class Envelope {
 public:
  /// Forgets the points that are too old at a time x, but not the slope.
  void expire(double x);

  /// Takes a point. Times may not decrease; one that does is treated as the newest.
  void add(const Point& point);

  /// Forgets the points; the slope stays until new ones contradict it.
  void restart() { points_.clear(); }

  bool empty() const { return points_.empty(); }

  /// The line at a time. There must be a point.
  double at(double x) const { return height_ + slope_ * (x - newest_); }

  double slope() const { return slope_; }

  /// [s] between the oldest and the newest point.
  double span() const { return points_.empty() ? 0 : newest_ - points_.front().x; }

 private:
  void fit();
  std::vector<Point> hull() const;

  std::deque<Point> points_;  // the lowest one of each bucket
  double bucket_end_ = 0;     // [s] of the newest one
  double newest_ = 0;         // [s] time of the newest point
  double height_ = 0;         // [s] of the line there
  double slope_ = 0;
};

}  // namespace kurumaisu::laser
