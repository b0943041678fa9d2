// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/camera/column.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "raycast/infinity.h"

namespace kurumaisu {
namespace {

/// Slope to a rise [m] at a distance [m], which may be 0.
double slopeTo(double rise, double distance) {
  if (distance > 0) return rise / distance;
  if (rise == 0) return 0.0;
  return rise > 0 ? kInfinity : -kInfinity;
}

/// Height above the eye of the lid that it sees; 0: none.
double lidOf(const Crossing& wall) {
  if (wall.high < 0) return wall.high;
  return std::max(wall.low, 0.0);
}

}  // namespace

void ColumnPainter::paint(const std::vector<Crossing>& around, const Crossing* crossings, std::size_t n,
                          double eye_height, const Background& background, std::vector<Span>& out) {
  gaps_.assign(1, {-kInfinity, kInfinity});
  open_.clear();
  for (const Crossing& wall : around) enter(wall);
  seen_.clear();
  for (std::size_t i = 0; i < n && !gaps_.empty(); ++i) {
    const Crossing& c = crossings[i];
    lidsUpTo(c.distance);
    show(slopeTo(c.low, c.distance), slopeTo(c.high, c.distance),
         {0.0F, static_cast<float>(c.distance), 0.0F, c.color});
    passThrough(c);
  }
  if (eye_height > 0) show(-kInfinity, 0.0, {0.0F, 0.0F, static_cast<float>(-eye_height), background.ground});
  show(-kInfinity, kInfinity, {0.0F, std::numeric_limits<float>::infinity(), 0.0F, background.sky});

  std::sort(seen_.begin(), seen_.end(), [](const Seen& a, const Seen& b) { return a.low > b.low; });
  for (Seen& seen : seen_) {
    seen.span.low = static_cast<float>(seen.low);
    out.push_back(seen.span);
  }
}

void ColumnPainter::enter(const Crossing& wall) {
  const auto nearer = [](const Open& open, const Crossing& other) {
    return std::fabs(lidOf(open.wall)) < std::fabs(lidOf(other));
  };
  open_.insert(std::lower_bound(open_.begin(), open_.end(), wall, nearer), {wall, wall.distance});
}

/// The face of a prism that the eye sees between two distances: the top from above, the bottom from below.
void ColumnPainter::lid(const Crossing& wall, double from, double to) {
  const double rise = lidOf(wall);
  if (rise == 0) return;
  const double a = slopeTo(rise, from);
  const double b = slopeTo(rise, to);
  show(std::min(a, b), std::max(a, b), {0.0F, 0.0F, static_cast<float>(rise), wall.color});
}

void ColumnPainter::lidsUpTo(double distance) {
  for (Open& open : open_) {
    lid(open.wall, open.reached, distance);
    open.reached = distance;
  }
}

/// Every other crossing of a closed outline leads out of it again.
void ColumnPainter::passThrough(const Crossing& crossing) {
  if (crossing.prism < 0) return;
  const auto same = [&](const Open& open) { return open.wall.prism == crossing.prism; };
  const auto found = std::find_if(open_.begin(), open_.end(), same);
  if (found == open_.end()) {
    enter(crossing);
  } else {
    open_.erase(found);
  }
}

/// Lets a surface be seen where nothing nearer covers it.
void ColumnPainter::show(double low, double high, const Span& span) {
  if (!(low < high)) return;
  rest_.clear();
  for (const auto& [bottom, top] : gaps_) {
    const double from = std::max(low, bottom);
    const double to = std::min(high, top);
    if (!(from < to)) {
      rest_.emplace_back(bottom, top);
      continue;
    }
    seen_.push_back({from, to, span});
    if (bottom < from) rest_.emplace_back(bottom, from);
    if (to < top) rest_.emplace_back(to, top);
  }
  gaps_.swap(rest_);
}

}  // namespace kurumaisu
