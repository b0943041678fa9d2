// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/sight.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace kurumaisu {
namespace {

Ray rayAt(const Pose& pose, double angle) { return {pose.x, pose.y, std::cos(angle), std::sin(angle)}; }

/// Keeps the nearer one; of two at the same range the stronger, so that the order of bodies does not matter.
void keepNearer(double range, double ranger_return, double range_max, Echo& echo) {
  if (range > range_max || range > echo.range || std::isinf(range)) return;
  if (range < echo.range || ranger_return > echo.ranger_return) echo = {range, ranger_return};
}

bool visible(const Face& face, double body_z, double z) {
  return face.ranger_return >= 0 && z >= body_z + face.z_low && z <= body_z + face.z_high;
}

bool mayBeSeen(const Bodies::Cylinder& around, const Viewpoint& from) {
  return from.pose.z >= around.z_low && from.pose.z <= around.z_high && !related(around.tree, from.tree);
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

constexpr double kRough = 2e-5;  // [rad] twice the error of roughDirection

/// Direction [rad] of a vector; Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.49.
double roughDirection(double dx, double dy) {
  const double x = std::abs(dx);
  const double y = std::abs(dy);
  const double t = std::min(x, y) / std::max(x, y);
  const double tt = t * t;
  double angle = t * (0.9998660 + tt * (-0.3302995 + tt * (0.1801410 + tt * (-0.0851330 + tt * 0.0208351))));
  if (y > x) angle = kTurn / 4 - angle;
  if (dx < 0) angle = kTurn / 2 - angle;
  return dy < 0 ? -angle : angle;
}

/// The view of bodies through one fan.
class FanView {
 public:
  FanView(const Viewpoint& from, const Beams& fan, Echo* echoes)
      : from_(from.pose), fan_(fan), finder_(fan, from.pose.heading), echoes_(echoes) {}

  void see(const Bodies::Body& body, const Bodies::Cylinder& around) const {
    const double dx = around.x - from_.x;
    const double dy = around.y - from_.y;
    const double distance = std::sqrt(dx * dx + dy * dy);
    if (distance <= around.radius) {
      seeWhole(body, 0, kTurn, 0);
    } else {
      seeWhole(body, roughDirection(dx, dy), atLeastArcsine(around.radius / distance) + kRough,
               distance - around.radius);
    }
  }

 private:
  /// Few beams meet all faces; only where many beams meet many faces does it pay to look where each face is.
  void seeWhole(const Bodies::Body& body, double middle, double half, double nearest) const {
    constexpr double kBeams = 16.0;
    constexpr std::size_t kFaces = 4;
    if (body.faces.size() > kFaces && 2 * half > kBeams * std::abs(fan_.increment)) {
      for (std::size_t i = 0; i < body.faces.size(); ++i)
        if (visible(body.faces[i], body.pose.z, from_.z)) seeFace(body.faces[i], body.placed[i]);
      return;
    }
    finder_.within(middle, half, [&](std::size_t i) {
      if (echoes_[i].range < nearest) return;  // something stands before the whole body
      testRay(body, rayOf(i), from_.z, fan_.range_max, echoes_[i]);
    });
  }

  void seeFace(const Face& face, const Segment& line) const {
    const double a = roughDirection(line.ax - from_.x, line.ay - from_.y);
    const double b = roughDirection(line.bx - from_.x, line.by - from_.y);
    const double span = std::remainder(b - a, kTurn);
    // From the face itself its ends are opposite or nowhere, and rounding decides on which side of it beams are.
    constexpr double kNearly = 1e-4;  // [rad] more than two directions may be wrong
    const bool on_it =
        std::abs(span) > kTurn / 2 - kNearly || isHere(line.ax, line.ay) || isHere(line.bx, line.by);
    const double middle = std::remainder(a + span / 2, kTurn);
    finder_.within(middle, on_it ? kTurn : std::abs(span) / 2 + kRough, [&](std::size_t i) {
      keepNearer(rangeTo(rayOf(i), line), face.ranger_return, fan_.range_max, echoes_[i]);
    });
  }

  bool isHere(double x, double y) const {
    constexpr double kHere = 1e-9;  // [m]
    return std::abs(x - from_.x) < kHere && std::abs(y - from_.y) < kHere;
  }

  Ray rayOf(std::size_t beam) const {
    return rayAt(from_, from_.heading + (fan_.first + static_cast<double>(beam) * fan_.increment));
  }

  const Pose& from_;
  const Beams& fan_;
  BeamFinder finder_;
  Echo* echoes_;
};

void seeAlong(const Bodies& bodies, int number, const Viewpoint& from, double range_max, Echo& echo,
              const Ray& ray) {
  const Bodies::Cylinder& around = bodies.cylinder(number);
  const double dx = around.x - ray.x;
  const double dy = around.y - ray.y;
  const double aside = ray.dx * dy - ray.dy * dx;
  const double ahead = ray.dx * dx + ray.dy * dy;
  if (std::abs(aside) > around.radius || ahead < -around.radius || ahead > echo.range + around.radius) return;
  if (mayBeSeen(around, from)) testRay(bodies[number], ray, from.pose.z, range_max, echo);
}

}  // namespace

void seeBodies(const Bodies& bodies, const Viewpoint& from, const Beams& fan, Echo* echoes) {
  if (fan.samples == 0) return;
  const FanView view(from, fan, echoes);
  bodies.near(from.pose.x, from.pose.y, fan.range_max, [&](int number) {
    const Bodies::Cylinder& around = bodies.cylinder(number);
    if (mayBeSeen(around, from)) view.see(bodies[number], around);
  });
}

// Rays that follow each other mostly leave from nearly the same place: they share one search.
void seeBodies(const Bodies& bodies, const Viewpoint* from, std::size_t n, double range_max, Echo* echoes) {
  constexpr double kSamePlace = 0.5;  // [m]
  std::vector<int> found;
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < n; begin = end) {
    const Pose& place = from[begin].pose;
    double reach = 0.0;
    double spread = 0.0;
    for (end = begin; end < n; ++end) {
      const double away = std::hypot(from[end].pose.x - place.x, from[end].pose.y - place.y);
      if (away > kSamePlace) break;
      reach = std::max(reach, std::min(range_max, echoes[end].range));
      spread = std::max(spread, away);
    }
    found.clear();
    bodies.near(place.x, place.y, reach + spread, [&](int number) { found.push_back(number); });
    if (found.empty()) continue;
    for (std::size_t i = begin; i < end; ++i) {
      const Ray ray = rayAt(from[i].pose, from[i].pose.heading);
      for (const int number : found) seeAlong(bodies, number, from[i], range_max, echoes[i], ray);
    }
  }
}

}  // namespace kurumaisu
