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

/// A point that moves with a body.
struct Carried {
  Point at;
  Point velocity;  // [m/s]
};

Carried carry(const Mover& mover, const Pose& pose, const Point& point) {
  const Point at = toMap(pose, point);
  const double turned = mover.frame == Frame::body ? pose.heading : 0;
  const double c = std::cos(turned);
  const double s = std::sin(turned);
  const auto [x, y, turn] = mover.twist;
  return {at, {c * x - s * y - turn * (at.y - pose.y), s * x + c * y + turn * (at.x - pose.x)}};
}

/// Upper bound [m/s^2] of the acceleration of a point so far from the origin [m].
double acceleration(const Mover& mover, double distance) {
  const double turn = std::abs(mover.twist.turn);
  return turn *
         (turn * distance + (mover.frame == Frame::body ? std::hypot(mover.twist.x, mover.twist.y) : 0));
}

/// Lower bound of the time until a gap is closed: at a speed now, which rises by so much acceleration at most.
double timeToClose(double gap, double speed, double acceleration) {
  const double root = std::sqrt(speed * speed + 2 * acceleration * gap);
  if (speed + root > 0) return 2 * gap / (speed + root);
  return INFINITY;
}

struct Gap {
  double distance;  // [m] from a corner to the nearest point of an edge
  double closing;   // [m/s] upper bound for all of the edge, along the line between these two
};

Gap gapOf(const Carried& corner, const Carried& a, const Carried& b) {
  const Point near = nearest(corner.at, a.at, b.at);
  const Point between{corner.at.x - near.x, corner.at.y - near.y};
  const double d = norm(between);
  if (d <= 0) return {0, 0};
  const auto along = [&](const Point& v) { return (v.x * between.x + v.y * between.y) / d; };
  return {d, std::max(along(a.velocity), along(b.velocity)) - along(corner.velocity)};
}

/// First time at which a corner of one body comes near an edge of another.
double cornerTouch(const Mover& a, const Point& corner, const Mover& b, const Edge& edge, const Touch& touch,
                   double limit) {
  const double rise = acceleration(a, norm(corner)) + acceleration(b, std::max(norm(edge.a), norm(edge.b)));
  double time = 0;
  double target = touch.distance;
  for (int i = 0; i < kMaxAdvances; ++i) {
    const Pose pose_b = b.at(time);
    const Gap gap = gapOf(carry(a, a.at(time), corner), carry(b, pose_b, edge.a), carry(b, pose_b, edge.b));
    if (i == 0 && gap.distance <= touch.known) {
      // A gap less than give may close and turn into an overlap, which distances do not tell from a gap.
      if (gap.distance <= touch.give) return std::min(limit, timeToClose(touch.give, gap.closing, rise));
      target = gap.distance - touch.give;
    }
    const double left = gap.distance - target;
    if (left <= kArrived * touch.distance && gap.closing > 0) return time;
    time += timeToClose(std::max(left, kArrived * touch.distance), gap.closing, rise);
    if (time >= limit) return limit;
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

Point nearest(const Point& point, const Point& a, const Point& b) {
  const Point along{b.x - a.x, b.y - a.y};
  const Point from{point.x - a.x, point.y - a.y};
  const double square = along.x * along.x + along.y * along.y;
  const double share =
      square > 0 ? std::clamp((from.x * along.x + from.y * along.y) / square, 0.0, 1.0) : 0.0;
  return {a.x + share * along.x, a.y + share * along.y};
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
