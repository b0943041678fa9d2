// SPDX-License-Identifier: BSD-3-Clause
// Edges that move as one, and when a corner of one body first comes close to an edge of another.
#pragma once

#include <vector>

namespace kurumaisu::contact {

struct Point {
  double x;  ///< [m]
  double y;  ///< [m]
};

/// A vertical strip between two points, from z = low to high [m].
struct Edge {
  Point a;
  Point b;
  double low;
  double high;
};

/// What is rigid: edges in the body's frame. Bodies of one tree never touch each other.
struct Outline {
  std::vector<Edge> edges;
  int tree;
  double radius;  ///< [m] of the circle about the frame's origin that holds all edges
};

struct Pose {
  double x;        ///< [m]
  double y;        ///< [m]
  double z;        ///< [m] added to the edges' heights
  double heading;  ///< [rad]
};

/// Rates: along x and y [m/s], turn [rad/s].
struct Twist {
  double x;
  double y;
  double turn;
};

/// In whose frame a twist stays the same.
enum class Frame {
  body,  ///< the body drives an arc
  map    ///< the body's origin goes straight on
};

/// An outline on its way.
struct Mover {
  const Outline* outline;
  Pose pose;  ///< at time 0
  Twist twist;
  Frame frame;

  Pose at(double time) const;
  /// Upper bound of the speed [m/s] of a point so far from the origin [m].
  double speed(double distance) const;
};

/// Nearer than this distance [m] is touching. What is nearer than known [m] already at the start may come nearer by
/// give [m].
struct Touch {
  double known;
  double distance;
  double give;
};

Point toMap(const Pose& pose, const Point& point);
/// The point of a line segment that is nearest to a point.
Point nearest(const Point& point, const Point& a, const Point& b);
bool sameHeight(const Edge& a, double z_a, const Edge& b, double z_b);

/// First time [s] at which an edge of a body comes near an edge of another, or limit.
/// Corners are followed by conservative advancement (Mirtich 1996): no advance is longer than closing the gap takes.
double firstTouch(const Mover& a, const Mover& b, const Touch& touch, double limit);

}  // namespace kurumaisu::contact
