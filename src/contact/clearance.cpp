// SPDX-License-Identifier: BSD-3-Clause
#include "contact/clearance.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace kurumaisu::contact {

namespace {

/// Pairs of movers of different trees whose circles, widened by the fastest one's way (it may push any), overlap:
/// sorted along x, then swept.
std::vector<std::pair<int, int>> neighbours(const std::vector<Mover>& movers, double limit, double distance) {
  double speed = 0;
  for (const Mover& mover : movers) speed = std::max(speed, mover.speed(0));
  const auto reach = [&](int i) {
    return movers[static_cast<std::size_t>(i)].outline->radius + limit * speed + distance;
  };
  const auto pose = [&](int i) -> const Pose& { return movers[static_cast<std::size_t>(i)].pose; };
  const auto tree = [&](int i) { return movers[static_cast<std::size_t>(i)].outline->tree; };
  std::vector<int> order(movers.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return std::pair(pose(a).x - reach(a), a) < std::pair(pose(b).x - reach(b), b);
  });
  std::vector<std::pair<int, int>> found;
  for (auto a = order.begin(); a != order.end(); ++a) {
    const double right = pose(*a).x + reach(*a);
    for (auto b = a + 1; b != order.end() && pose(*b).x - reach(*b) <= right; ++b) {
      if (tree(*a) == tree(*b)) continue;
      const double apart = std::hypot(pose(*a).x - pose(*b).x, pose(*a).y - pose(*b).y);
      if (apart <= reach(*a) + reach(*b)) found.emplace_back(std::min(*a, *b), std::max(*a, *b));
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

double radiusOf(const std::vector<Edge>& edges) {
  double radius = 0;
  for (const Edge& edge : edges) {
    radius = std::max({radius, std::hypot(edge.a.x, edge.a.y), std::hypot(edge.b.x, edge.b.y)});
  }
  return radius;
}

Circle circleOf(const Mover& mover, double reach) {
  return {{mover.pose.x, mover.pose.y}, mover.outline->radius + reach};
}

}  // namespace

int Clearance::add(std::vector<Edge> edges, int tree) {
  const double radius = radiusOf(edges);
  outlines_.push_back({std::move(edges), tree, radius});
  return static_cast<int>(outlines_.size()) - 1;
}

void Clearance::replace(int body, std::vector<Edge> edges) {
  Outline& outline = outlines_.at(static_cast<std::size_t>(body));
  outline.radius = radiusOf(edges);
  outline.edges = std::move(edges);
}

Mover Clearance::mover(int body, const Pose& pose, const Twist& twist, Frame frame) const {
  return {&outlines_.at(static_cast<std::size_t>(body)), pose, twist, frame};
}

Clearance::Free Clearance::free(const std::vector<Mover>& movers, double limit, double distance) const {
  const Touch touch{-1, distance, 0};  // nothing is known before
  Free result{std::vector<double>(movers.size(), limit), neighbours(movers, limit, distance)};
  for (std::size_t i = 0; i < movers.size(); ++i) {
    if (movers[i].speed(1) > 0) result.times[i] = wallTouch(movers[i], touch, limit);
  }
  for (const auto& [a, b] : result.pairs) {
    const auto i = static_cast<std::size_t>(a);
    const auto j = static_cast<std::size_t>(b);
    if (movers[i].speed(1) + movers[j].speed(1) <= 0) continue;
    const double time = contact::firstTouch(movers[i], movers[j], touch, limit);
    result.times[i] = std::min(result.times[i], time);
    result.times[j] = std::min(result.times[j], time);
  }
  return result;
}

double Clearance::firstTouch(const std::vector<Mover>& movers, const Touch& touch, double limit) const {
  for (const Mover& mover : movers) limit = wallTouch(mover, touch, limit);
  for (const auto& [a, b] : neighbours(movers, limit, touch.distance)) {
    limit = contact::firstTouch(movers[static_cast<std::size_t>(a)], movers[static_cast<std::size_t>(b)],
                                touch, limit);
  }
  return limit;
}

std::vector<int> Clearance::near(const std::vector<Mover>& movers, double reach) const {
  std::vector<int> found;
  for (const Mover& mover : movers) {
    for (const int wall : walls_.near(circleOf(mover, reach))) {
      if (walls_[wall].tree != mover.outline->tree) found.push_back(wall);
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

double Clearance::wallTouch(const Mover& mover, const Touch& touch, double limit) const {
  for (const int index : walls_.near(circleOf(mover, limit * mover.speed(0) + touch.distance))) {
    const Wall& wall = walls_[index];
    if (wall.tree == mover.outline->tree) continue;
    const Outline outline{{wall.edge}, wall.tree, INFINITY};
    limit = contact::firstTouch(mover, {&outline, {0, 0, 0, 0}, {0, 0, 0}, Frame::map}, touch, limit);
  }
  return limit;
}

}  // namespace kurumaisu::contact
