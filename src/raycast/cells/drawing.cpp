// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/cells/drawing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "raycast/cells/walk.h"

namespace kurumaisu {
namespace {

constexpr double kHalfTurn = 3.14159265358979323846;  // [rad]
constexpr double kFarthestDrawn = 1 << 30;            // cells
constexpr double kMostCells = 1e8;                    // of all outlines: some hundred MB

bool finite(const Pose& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z) && std::isfinite(p.heading);
}

[[noreturn]] void refuse(const char* what, std::size_t i, const char* why) {
  throw std::invalid_argument(std::string(what) + " " + std::to_string(i) + why);
}

void requirePart(const Part& part, std::size_t i) {
  if (part.parent < -1 || part.parent >= static_cast<int>(i))
    refuse("part", i, ": its parent must come before it");
  if (!finite(part.pose) || !finite(part.origin) || !std::isfinite(part.lift))
    refuse("part", i, " is not finite");
}

void requireEdge(const Edge& edge, std::size_t i, std::size_t parts) {
  const Segment& line = edge.line;
  if (edge.part < 0 || static_cast<std::size_t>(edge.part) >= parts)
    refuse("edge", i, ": there is no such part");
  if (!std::isfinite(line.ax + line.ay + line.bx + line.by)) refuse("edge", i, " is not finite");
  if (!(edge.z_low <= edge.z_high)) refuse("edge", i, ": z_low must not be above z_high");
}

void note(std::uint64_t tile, Drawing& drawing) {
  if (drawing.tiles.empty() || drawing.tiles.back() != tile) drawing.tiles.push_back(tile);
}

}  // namespace

double normalized(double angle) {
  constexpr double kMany = 1e4;  // [rad] more than any file says
  if (std::abs(angle) > kMany) angle = std::remainder(angle, 2 * kHalfTurn);
  while (angle < -kHalfTurn) angle += 2 * kHalfTurn;
  while (angle > kHalfTurn) angle -= 2 * kHalfTurn;
  return angle;
}

Pencil::Pencil(double resolution) : cells_per_metre_(1.0 / resolution) {
  if (!(resolution > 0) || !std::isfinite(resolution) || !std::isfinite(cells_per_metre_))
    throw std::invalid_argument("resolution must be positive, not " + std::to_string(resolution));
}

double Pencil::admit(const Outline& outline) {
  const Extent extent = measure(outline);
  if (!numbered({0, 0, 0, 0}, extent.reach))
    throw std::invalid_argument("an outline is more than 2^30 cells from its frame");
  if (!(cells_ + extent.cells <= kMostCells))
    throw std::invalid_argument("outlines have more than 10^8 cells: the resolution is too fine for them");
  cells_ += extent.cells;
  return extent.reach;
}

Pencil::Extent Pencil::measure(const Outline& outline) const {
  std::vector<double> reaches;
  for (std::size_t i = 0; i < outline.parts.size(); ++i) {
    const Part& part = outline.parts[i];
    requirePart(part, i);
    const double below = part.parent < 0 ? 0.0 : reaches[static_cast<std::size_t>(part.parent)];
    reaches.push_back(below + std::hypot(part.pose.x, part.pose.y));
  }
  double farthest = 0.0;
  double cells = 0.0;
  for (std::size_t i = 0; i < outline.edges.size(); ++i) {
    const Edge& edge = outline.edges[i];
    requireEdge(edge, i, outline.parts.size());
    const auto part = static_cast<std::size_t>(edge.part);
    const Pose& origin = outline.parts[part].origin;
    const Segment& line = edge.line;
    farthest = std::max(farthest, reaches[part] + std::hypot(origin.x, origin.y) +
                                      std::max(std::hypot(line.ax, line.ay), std::hypot(line.bx, line.by)));
    cells += std::abs(line.bx - line.ax) + std::abs(line.by - line.ay);
  }
  return {farthest, cells * cells_per_metre_};
}

bool Pencil::numbered(const Pose& at, double reach) const {
  return finite(at) && (std::max(std::abs(at.x), std::abs(at.y)) + reach) * cells_per_metre_ < kFarthestDrawn;
}

Pencil::Frame Pencil::attached(const Frame& frame, const Pose& pose) {
  Frame out{frame.x + pose.x * frame.cos - pose.y * frame.sin,
            frame.y + pose.x * frame.sin + pose.y * frame.cos,
            frame.z + pose.z,
            normalized(frame.heading + pose.heading),
            frame.cos,
            frame.sin};
  if (out.heading != frame.heading) {
    out.cos = std::cos(out.heading);
    out.sin = std::sin(out.heading);
  }
  return out;
}

void Pencil::draw(const Outline& outline, const Pose& at, Drawing& drawing) {
  drawing.cells.clear();
  drawing.strokes.clear();
  drawing.tiles.clear();
  constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
  drawing.low = {kMost, kMost};
  drawing.high = {-kMost, -kMost};
  drawing.in_ground = false;
  models_.clear();
  outlines_.clear();
  const Frame body{at.x, at.y, at.z, at.heading, std::cos(at.heading), std::sin(at.heading)};
  for (const Part& part : outline.parts) {
    Frame model =
        attached(part.parent < 0 ? body : models_[static_cast<std::size_t>(part.parent)], part.pose);
    model.z += part.lift;
    models_.push_back(model);
    outlines_.push_back(attached(model, part.origin));
  }
  for (const Edge& edge : outline.edges) {
    const Frame& frame = outlines_[static_cast<std::size_t>(edge.part)];
    const double low = edge.z_low + frame.z;
    const double high = edge.z_high + frame.z;
    drawing.in_ground = drawing.in_ground || low < 0;
    draw(edge.line, frame, drawing);
    if (drawing.strokes.empty() || drawing.strokes.back().z_low != low ||
        drawing.strokes.back().z_high != high || drawing.strokes.back().part != edge.part)
      drawing.strokes.push_back({low, high, edge.part, 0});
    drawing.strokes.back().end = drawing.cells.size();
  }
  std::sort(drawing.tiles.begin(), drawing.tiles.end());
  drawing.tiles.erase(std::unique(drawing.tiles.begin(), drawing.tiles.end()), drawing.tiles.end());
}

void Pencil::draw(const Segment& line, const Frame& frame, Drawing& drawing) const {
  const auto cellOf = [&](double at) { return static_cast<std::int32_t>(std::floor(at * cells_per_metre_)); };
  const Cell a{cellOf(frame.x + line.ax * frame.cos - line.ay * frame.sin),
               cellOf(frame.y + line.ax * frame.sin + line.ay * frame.cos)};
  const Cell b{cellOf(frame.x + line.bx * frame.cos - line.by * frame.sin),
               cellOf(frame.y + line.bx * frame.sin + line.by * frame.cos)};
  Walk walk(a.x, a.y, b.x - a.x, b.y - a.y);
  if (walk.left == 0) return;
  drawing.low = {std::min({drawing.low.x, a.x, b.x}), std::min({drawing.low.y, a.y, b.y})};
  drawing.high = {std::max({drawing.high.x, a.x, b.x}), std::max({drawing.high.y, a.y, b.y})};
  const std::size_t first = drawing.cells.size();
  drawing.cells.resize(first + static_cast<std::size_t>(walk.left));
  for (auto cell = drawing.cells.begin() + static_cast<std::ptrdiff_t>(first); walk.left > 0; walk.step())
    *cell++ = {static_cast<std::int32_t>(walk.x), static_cast<std::int32_t>(walk.y)};
  if (tiles::of(a) == tiles::of(b)) {
    note(tiles::of(a), drawing);
  } else {
    for (std::size_t i = first; i < drawing.cells.size(); ++i) note(tiles::of(drawing.cells[i]), drawing);
  }
}

}  // namespace kurumaisu
