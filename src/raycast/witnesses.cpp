// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/witnesses.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace kurumaisu {
namespace {

constexpr double kTouch = 1e-9;                // [m] segments nearer than this touch
constexpr std::size_t kMostPairs = 2'000'000;  // of segments to compare, about 20 ms

bool same(const Point& a, const Point& b) { return a.x == b.x && a.y == b.y; }

/// Adds one end of each set of segments that are connected by shared ends.
void addComponents(const std::vector<Segment>& segments, std::vector<Point>& witnesses) {
  std::vector<std::size_t> parent(segments.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  struct End {
    Point at;
    std::size_t segment;
  };
  std::vector<End> ends;
  ends.reserve(2 * segments.size());
  for (std::size_t i = 0; i < segments.size(); ++i) {
    ends.push_back({{segments[i].ax, segments[i].ay}, i});
    ends.push_back({{segments[i].bx, segments[i].by}, i});
  }
  std::sort(ends.begin(), ends.end(), [](const End& a, const End& b) {
    return std::tie(a.at.x, a.at.y, a.segment) < std::tie(b.at.x, b.at.y, b.segment);
  });
  for (std::size_t i = 1; i < ends.size(); ++i) {
    if (same(ends[i - 1].at, ends[i].at)) parent[root(ends[i].segment)] = root(ends[i - 1].segment);
  }
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (root(i) == i) witnesses.push_back({segments[i].ax, segments[i].ay});
  }
}

double distance(const Point& p, const Segment& s) {
  const double ex = s.bx - s.ax;
  const double ey = s.by - s.ay;
  const double squared = ex * ex + ey * ey;
  const double part =
      squared > 0 ? std::clamp(((p.x - s.ax) * ex + (p.y - s.ay) * ey) / squared, 0.0, 1.0) : 0.0;
  return std::hypot(s.ax + part * ex - p.x, s.ay + part * ey - p.y);
}

/// Adds the points where two segments touch but for a shared end.
void addTouches(const Segment& s, const Segment& r, std::vector<Point>& witnesses) {
  if (std::max(s.ax, s.bx) + kTouch < std::min(r.ax, r.bx) ||
      std::max(r.ax, r.bx) + kTouch < std::min(s.ax, s.bx) ||
      std::max(s.ay, s.by) + kTouch < std::min(r.ay, r.by) ||
      std::max(r.ay, r.by) + kTouch < std::min(s.ay, s.by)) {
    return;
  }
  const Point ends_s[] = {{s.ax, s.ay}, {s.bx, s.by}};
  const Point ends_r[] = {{r.ax, r.ay}, {r.bx, r.by}};
  const auto add = [&](const Point& p, const Segment& other, const Point* ends) {
    if (!same(p, ends[0]) && !same(p, ends[1]) && distance(p, other) < kTouch) witnesses.push_back(p);
  };
  for (const Point& p : ends_s) add(p, r, ends_r);
  for (const Point& p : ends_r) add(p, s, ends_s);
  const double ex = s.bx - s.ax;
  const double ey = s.by - s.ay;
  const auto side = [&](const Point& p) { return ex * (p.y - s.ay) - ey * (p.x - s.ax); };
  const double a = side(ends_r[0]);
  const double b = side(ends_r[1]);
  if (!((a < 0 && b > 0) || (a > 0 && b < 0))) return;
  const double part = a / (a - b);
  const Point crossing{r.ax + part * (r.bx - r.ax), r.ay + part * (r.by - r.ay)};
  if (distance(crossing, s) < kTouch) witnesses.push_back(crossing);
}

}  // namespace

std::optional<std::vector<Point>> findWitnesses(const std::vector<Segment>& segments, const Grid& grid) {
  std::vector<Point> witnesses;
  addComponents(segments, witnesses);
  const std::size_t cells = grid.index(grid.width() - 1, grid.height() - 1) + 1;
  std::size_t pairs = 0;
  for (std::size_t cell = 0; cell < cells; ++cell) {
    const auto count = static_cast<std::size_t>(grid.end(cell) - grid.begin(cell));
    pairs += count * count / 2;
  }
  if (pairs > kMostPairs) return std::nullopt;
  for (std::size_t cell = 0; cell < cells; ++cell) {
    for (const std::int32_t* i = grid.begin(cell); i != grid.end(cell); ++i) {
      for (const std::int32_t* j = i + 1; j != grid.end(cell); ++j) {
        addTouches(segments[static_cast<std::size_t>(*i)], segments[static_cast<std::size_t>(*j)], witnesses);
      }
    }
  }
  const auto before = [](const Point& a, const Point& b) { return std::tie(a.x, a.y) < std::tie(b.x, b.y); };
  std::sort(witnesses.begin(), witnesses.end(), before);
  witnesses.erase(std::unique(witnesses.begin(), witnesses.end(), same), witnesses.end());
  return witnesses;
}

}  // namespace kurumaisu
