// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/sight.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kurumaisu {
namespace {

const double kHalfTurn = kTurn / 2;

Ray rayAt(const Pose& pose, double angle) { return {pose.x, pose.y, std::cos(angle), std::sin(angle)}; }

/// Keeps the nearer one; of two at the same range the stronger, so that the order of bodies does not matter.
void keepNearer(double range, double ranger_return, double range_max, Echo& echo) {
  if (range > range_max || range > echo.range || std::isinf(range)) return;
  if (range < echo.range || ranger_return > echo.ranger_return) echo = {range, ranger_return};
}

bool visible(const Face& face, double body_z, double z) {
  return face.ranger_return >= 0 && z >= body_z + face.z_low && z <= body_z + face.z_high;
}

bool mayBeSeen(const Bodies& bodies, int number, const Viewpoint& from) {
  const Bodies::Body& body = bodies[number];
  return !related(bodies.circle(number).tree, from.tree) && from.pose.z >= body.pose.z + body.z_low &&
         from.pose.z <= body.pose.z + body.z_high;
}

void testRay(const Bodies::Body& body, const Ray& ray, double z, double range_max, Echo& echo) {
  for (std::size_t i = 0; i < body.faces.size(); ++i) {
    if (!visible(body.faces[i], body.pose.z, z)) continue;
    keepNearer(rangeTo(ray, body.placed[i]), body.faces[i].ranger_return, range_max, echo);
  }
}

/// An angle that is surely at least asin(x), for x in [0, 1].
double atLeastArcsine(double x) {
  return x * (1 + (kTurn / 4 - 1) * x * x);  // all coefficients of the series beyond x put together
}

/// One body before one fan.
class Splat {
 public:
  Splat(const Bodies::Body& body, const Viewpoint& from, const Fan& fan, Echo* echoes)
      : body_(body), from_(from.pose), fan_(fan), echoes_(echoes) {}

  /// Few beams meet all faces; only where many beams meet many faces does it pay to look where each face is.
  void whole(double middle, double half, double nearest) const {
    constexpr double kBeams = 16.0;
    constexpr std::size_t kFaces = 4;
    if (body_.faces.size() > kFaces && 2 * half > kBeams * std::abs(fan_.increment)) {
      for (std::size_t i = 0; i < body_.faces.size(); ++i)
        if (visible(body_.faces[i], body_.pose.z, from_.z)) face(i);
      return;
    }
    visitBeams(fan_, middle, half, [&](std::size_t i) {
      if (echoes_[i].range < nearest) return;  // something stands before the whole body
      testRay(body_, rayAt(from_, angle(i)), from_.z, fan_.range_max, echoes_[i]);
    });
  }

 private:
  double angle(std::size_t beam) const {
    return from_.heading + (fan_.first + static_cast<double>(beam) * fan_.increment);
  }

  void face(std::size_t number) const {
    const Segment& line = body_.placed[number];
    const double a = std::atan2(line.ay - from_.y, line.ax - from_.x);
    const double b = std::atan2(line.by - from_.y, line.bx - from_.x);
    const double span = std::remainder(b - a, kTurn);
    // On the face itself its ends are opposite or nowhere, and rounding decides on which side of it beams are.
    constexpr double kNearly = 1e-6;  // [rad]
    constexpr double kAtEnd = 1e-9;   // [m]
    const bool on_it = std::abs(span) > kHalfTurn - kNearly || atEnd(line.ax, line.ay, kAtEnd) ||
                       atEnd(line.bx, line.by, kAtEnd);
    visitBeams(fan_, a + span / 2 - from_.heading, on_it ? kTurn : std::abs(span) / 2, [&](std::size_t i) {
      keepNearer(rangeTo(rayAt(from_, angle(i)), line), body_.faces[number].ranger_return, fan_.range_max,
                 echoes_[i]);
    });
  }

  bool atEnd(double x, double y, double within) const {
    return std::abs(x - from_.x) < within && std::abs(y - from_.y) < within;
  }

  const Bodies::Body& body_;
  const Pose& from_;
  const Fan& fan_;
  Echo* echoes_;
};

}  // namespace

void seeBodies(const Bodies& bodies, const Viewpoint& from, const Fan& fan, Echo* echoes) {
  if (fan.samples == 0) return;
  bodies.near(from.pose.x, from.pose.y, fan.range_max, [&](int number) {
    if (!mayBeSeen(bodies, number, from)) return;
    const Bodies::Circle& circle = bodies.circle(number);
    const double dx = circle.x - from.pose.x;
    const double dy = circle.y - from.pose.y;
    const double distance = std::sqrt(dx * dx + dy * dy);
    const Splat splat(bodies[number], from, fan, echoes);
    if (distance <= circle.radius) {
      splat.whole(0, kTurn, 0);
    } else {
      splat.whole(std::atan2(dy, dx) - from.pose.heading, atLeastArcsine(circle.radius / distance),
                  distance - circle.radius);
    }
  });
}

Echo seeBodies(const Bodies& bodies, const Viewpoint& from, double range_max, Echo echo) {
  const Ray ray = rayAt(from.pose, from.pose.heading);
  bodies.near(from.pose.x, from.pose.y, std::min(range_max, echo.range), [&](int number) {
    const Bodies::Circle& circle = bodies.circle(number);
    const double dx = circle.x - ray.x;
    const double dy = circle.y - ray.y;
    const double aside = ray.dx * dy - ray.dy * dx;
    if (std::abs(aside) > circle.radius || ray.dx * dx + ray.dy * dy < -circle.radius) return;
    if (mayBeSeen(bodies, number, from)) testRay(bodies[number], ray, from.pose.z, range_max, echo);
  });
  return echo;
}

}  // namespace kurumaisu
