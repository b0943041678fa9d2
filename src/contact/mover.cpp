// SPDX-License-Identifier: BSD-3-Clause
#include "contact/mover.h"

#include <algorithm>
#include <cmath>

namespace kurumaisu::contact {

namespace {

constexpr int kMaxAdvances = 100000;  // a guard; each advance covers at least 1 % of the touching distance
constexpr double kArrived = 0.01;  // [1] of the touching distance that may be left when it counts as reached

/// sin(x) / x; below the bound the series is exact to double precision.
double sinc(double x) { return std::abs(x) < 1e-4 ? 1 - x * x / 6 : std::sin(x) / x; }

double norm(const Point& p) { return std::hypot(p.x, p.y); }

/// First time at which a corner of one body comes near an edge of another.
double cornerTouch(const Mover& a, const Point& corner, const Mover& b, const Edge& edge, const Touch& touch,
                   double limit) {
  const double speed = a.speed(norm(corner)) + b.speed(std::max(norm(edge.a), norm(edge.b)));
  double time = 0;
  for (int i = 0; i < kMaxAdvances; ++i) {
    const Pose pose_b = b.at(time);
    const double d = distance(toMap(a.at(time), corner), toMap(pose_b, edge.a), toMap(pose_b, edge.b));
    if (i == 0 && d <= touch.known) return limit;
    const double gap = d - touch.distance;
    if (gap <= kArrived * touch.distance) return time;
    if (gap >= speed * (limit - time)) return limit;
    time += gap / speed;
  }
  return time;
}

double cornersTouch(const Mover& a, const Mover& b, const Touch& touch, double limit) {
  for (const Edge& corner : a.outline->edges) {
    for (const Edge& edge : b.outline->edges) {
      if (!sameHeight(corner, a.pose.z, edge, b.pose.z)) continue;
      limit = cornerTouch(a, corner.a, b, edge, touch, limit);
      limit = cornerTouch(a, corner.b, b, edge, touch, limit);
    }
  }
  return limit;
}

}  // namespace

Pose Mover::at(double time) const {
  // The chord of the arc points half the turn further, as in model/unicycle; there without a leftward rate.
  const double half_turn = frame == Frame::body ? 0.5 * twist.turn * time : 0;
  const double direction = frame == Frame::body ? pose.heading + half_turn : 0;
  const double chord = time * sinc(half_turn);
  const double c = std::cos(direction);
  const double s = std::sin(direction);
  return {pose.x + chord * (c * twist.x - s * twist.y), pose.y + chord * (s * twist.x + c * twist.y), pose.z,
          pose.heading + twist.turn * time};
}

double Mover::speed(double distance) const {
  return std::hypot(twist.x, twist.y) + std::abs(twist.turn) * distance;
}

Point toMap(const Pose& pose, const Point& point) {
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  return {pose.x + c * point.x - s * point.y, pose.y + s * point.x + c * point.y};
}

double distance(const Point& point, const Point& a, const Point& b) {
  const Point along{b.x - a.x, b.y - a.y};
  const Point from{point.x - a.x, point.y - a.y};
  const double square = along.x * along.x + along.y * along.y;
  const double share =
      square > 0 ? std::clamp((from.x * along.x + from.y * along.y) / square, 0.0, 1.0) : 0.0;
  return std::hypot(from.x - share * along.x, from.y - share * along.y);
}

bool sameHeight(const Edge& a, double z_a, const Edge& b, double z_b) {
  return a.low + z_a < b.high + z_b && b.low + z_b < a.high + z_a;
}

double firstTouch(const Mover& a, const Mover& b, const Touch& touch, double limit) {
  const double reach =
      a.outline->radius + b.outline->radius + touch.distance + limit * (a.speed(0) + b.speed(0));
  if (std::hypot(a.pose.x - b.pose.x, a.pose.y - b.pose.y) > reach) return limit;
  return cornersTouch(b, a, touch, cornersTouch(a, b, touch, limit));
}

}  // namespace kurumaisu::contact
