// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/cells/rays.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "raycast/infinity.h"

namespace kurumaisu {
namespace {

constexpr double kFarthestCell = 1 << 30;  // cells

bool samePose(const Pose& a, const Pose& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z && a.heading == b.heading;
}

bool inside(const Cell& cell, std::uint64_t region) { return regions::of(cell) == region; }

}  // namespace

CellRays::CellRays(double resolution, int threads)
    : cells_per_metre_(1.0 / resolution), pencil_(resolution), pool_(threads) {}

int CellRays::add(Outline outline, std::vector<double> returns, int tree) {
  if (returns.size() != outline.parts.size()) throw std::invalid_argument("returns must be one of each part");
  const std::lock_guard<std::mutex> lock(mutex_);
  const double reach = pencil_.admit(outline);
  const int number = static_cast<int>(things_.size());
  things_.push_back({std::move(outline), std::move(returns), reach, tree, {0, 0, 0, 0}, {}});
  Thing& thing = things_.back();
  pencil_.draw(thing.outline, thing.pose, thing.drawing);
  regions_.add(thing.drawing, number);
  return number;
}

void CellRays::setPoses(const std::vector<int>& things, const Pose* poses) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < things.size(); ++i) {
    if (things[i] < 0 || static_cast<std::size_t>(things[i]) >= things_.size())
      throw std::invalid_argument("there is no body " + std::to_string(things[i]));
    if (!pencil_.numbered(poses[i], at(things[i]).reach))
      throw std::invalid_argument("pose " + std::to_string(i) + " is not finite, or beyond 2^30 cells");
  }
  for (std::size_t i = 0; i < things.size(); ++i) {
    Thing& thing = things_[static_cast<std::size_t>(things[i])];
    if (samePose(thing.pose, poses[i])) continue;
    regions_.remove(thing.drawing, things[i]);
    thing.pose = poses[i];
    pencil_.draw(thing.outline, thing.pose, thing.drawing);
    regions_.add(thing.drawing, things[i]);
  }
}

void CellRays::require(const Viewpoint& from, double range_max) const {
  if (!(range_max > 0))
    throw std::invalid_argument("range_max must be positive, not " + std::to_string(range_max));
  if (!(range_max * cells_per_metre_ < kFarthestCell))
    throw std::invalid_argument("range_max of " + std::to_string(range_max) + " m is beyond 2^30 cells");
  if (!pencil_.numbered(from.pose, 0))
    throw std::invalid_argument("an origin is not finite, or beyond 2^30 cells");
}

void CellRays::scan(const std::vector<Viewpoint>& from, const std::vector<Beams>& fans, double* ranges,
                    double* returns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::size_t> offsets{0};
  for (std::size_t i = 0; i < from.size(); ++i) {
    require(from[i], fans[i].range_max);
    if (!std::isfinite(fans[i].first + fans[i].increment))
      throw std::invalid_argument("fan " + std::to_string(i) + " is not finite");
    offsets.push_back(offsets.back() + fans[i].samples);
  }
  pool_.run(from.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      // Stage adds increments up, and rounds to a float each time.
      auto direction = static_cast<float>(normalized(from[i].pose.heading + fans[i].first));
      for (std::size_t j = offsets[i]; j < offsets[i + 1]; ++j) {
        const Echo echo = cast(from[i], static_cast<double>(direction), fans[i].range_max);
        ranges[j] = echo.range;
        returns[j] = echo.ranger_return;
        direction = static_cast<float>(static_cast<double>(direction) + fans[i].increment);
      }
    }
  });
}

void CellRays::cast(const std::vector<Viewpoint>& from, double range_max, double* ranges, double* returns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Viewpoint& place : from) require(place, range_max);
  pool_.run(from.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto direction = static_cast<float>(normalized(from[i].pose.heading));
      const Echo echo = cast(from[i], static_cast<double>(direction), range_max);
      ranges[i] = echo.range;
      returns[i] = echo.ranger_return;
    }
  });
}

Echo CellRays::cast(const Viewpoint& from, double direction, double range_max) const {
  CellRay ray(from.pose.x * cells_per_metre_, from.pose.y * cells_per_metre_, direction,
              cells_per_metre_ * range_max);
  while (!ray.ended()) {
    Cell cell = ray.cell();
    const Regions::Region* region = regions_.at(cell);
    if (region == nullptr) {
      ray.jump();
      continue;
    }
    for (const std::uint64_t here = regions::of(cell); inside(cell, here) && !ray.ended(); ray.step(cell)) {
      if (const double* value = seen(*region, cell, from)) return {ray.range() / cells_per_metre_, *value};
    }
  }
  return {kInfinity, 0.0};
}

const double* CellRays::seen(const Regions::Region& region, const Cell& cell, const Viewpoint& from) const {
  for (std::int32_t i = Regions::first(region, cell); i >= 0; i = regions_.mark(i).next) {
    const Regions::Mark& mark = regions_.mark(i);
    const Thing& thing = at(mark.thing);
    const Drawing::Stroke& stroke = thing.drawing.strokes[static_cast<std::size_t>(mark.stroke)];
    const double& value = thing.returns[static_cast<std::size_t>(stroke.part)];
    if (from.pose.z < stroke.z_low || from.pose.z > stroke.z_high) continue;
    if (value >= 0 && !related(thing.tree, from.tree)) return &value;
  }
  return nullptr;
}

}  // namespace kurumaisu
