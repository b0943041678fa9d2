// SPDX-License-Identifier: BSD-3-Clause
#include "laser/envelope.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kurumaisu::laser {
namespace {

constexpr double kWindow = 30;       // [s] longer: steadier; shorter: follows a change of the rate sooner
constexpr double kBucket = 0.5;      // [s]
constexpr double kSlopeMax = 0.005;  // of a sensor's clock; a recorded URG-04LX is off by 0.0013
constexpr double kDoubt = 1;         // [s] from the middle to where the edges must agree, while there are few
constexpr double kDoubtShare = 0.125;  // of the span, once there are many

double slopeBetween(const Point& a, const Point& b) { return (b.y - a.y) / (b.x - a.x); }

/// Slope of the hull's edge over x; infinite outside.
double slopeAt(const std::vector<Point>& hull, double x) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (x <= hull.front().x) return -kInfinity;
  if (x >= hull.back().x) return kInfinity;
  std::size_t right = 1;
  while (hull[right].x < x) ++right;
  return slopeBetween(hull[right - 1], hull[right]);
}

}  // namespace

void Envelope::expire(double x) {
  while (!points_.empty() && points_.front().x < x - kWindow) points_.pop_front();
}

void Envelope::add(const Point& point) {
  const Point added{points_.empty() ? point.x : std::max(point.x, newest_), point.y};
  if (points_.empty() || added.x >= bucket_end_) {
    points_.push_back(added);
    bucket_end_ = added.x + kBucket;
  } else if (added.y - points_.back().y < slope_ * (added.x - points_.back().x)) {
    points_.back() = added;
  }
  newest_ = added.x;
  expire(newest_);
  fit();
}

std::vector<Point> Envelope::hull() const {
  std::vector<Point> hull;
  for (const Point& point : points_) {
    while (hull.size() > 1 &&
           slopeBetween(hull[hull.size() - 2], hull.back()) >= slopeBetween(hull.back(), point)) {
      hull.pop_back();
    }
    hull.push_back(point);
  }
  return hull;
}

void Envelope::fit() {
  // The highest line over the points' middle leans on the hull's edge there. It is turned only as far as the edges on
  // both sides of the middle agree on: a few points prove nothing.
  const std::vector<Point> edges = hull();
  const double middle = 0.5 * (edges.front().x + newest_);
  const double doubt = std::max(kDoubt, kDoubtShare * span());
  slope_ = std::clamp(slope_, slopeAt(edges, middle - doubt), slopeAt(edges, middle + doubt));
  slope_ = std::clamp(slope_, -kSlopeMax, kSlopeMax);
  height_ = std::numeric_limits<double>::infinity();
  for (const Point& point : edges) height_ = std::min(height_, point.y + slope_ * (newest_ - point.x));
}

}  // namespace kurumaisu::laser
