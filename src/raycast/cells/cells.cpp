// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/cells/cells.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace kurumaisu {
namespace {

/// A cell that is drawn, and by which stroke.
struct Trace {
  std::uint64_t cell;
  const Drawing::Stroke* stroke;
};

bool overlap(const Drawing& one, const Drawing& other) {
  return one.low.x <= other.high.x && other.low.x <= one.high.x && one.low.y <= other.high.y &&
         other.low.y <= one.high.y;
}

/// Cells of one drawing within the box of another.
std::vector<Trace> within(const Drawing& drawing, const Drawing& box) {
  std::vector<Trace> traces;
  std::size_t i = 0;
  for (const Drawing::Stroke& stroke : drawing.strokes) {
    for (; i < stroke.end; ++i) {
      const Cell& cell = drawing.cells[i];
      if (cell.x >= box.low.x && cell.x <= box.high.x && cell.y >= box.low.y && cell.y <= box.high.y)
        traces.push_back({tiles::pair(cell.x, cell.y), &stroke});
    }
  }
  return traces;
}

bool meet(const Drawing& one, const Drawing& other) {
  if (!overlap(one, other)) return false;
  std::vector<Trace> mine = within(one, other);
  if (mine.empty()) return false;
  const auto before = [](const Trace& a, const Trace& b) { return a.cell < b.cell; };
  std::sort(mine.begin(), mine.end(), before);
  const std::vector<Trace> theirs = within(other, one);
  return std::any_of(theirs.begin(), theirs.end(), [&](const Trace& their) {
    const auto same = std::equal_range(mine.begin(), mine.end(), their, before);
    return std::any_of(same.first, same.second, [&](const Trace& my) {
      return my.stroke->z_low <= their.stroke->z_high && my.stroke->z_high >= their.stroke->z_low;
    });
  });
}

int checkedLayers(int layers) {
  if (layers == 1 || layers == 2) return layers;
  throw std::invalid_argument("layers must be 1 or 2, not " + std::to_string(layers));
}

}  // namespace

Cells::Cells(double resolution, int layers)
    : pencil_(resolution), shelves_(static_cast<std::size_t>(checkedLayers(layers))) {}

void Cells::addWalls(const Outline& outline, int tree) {
  const std::lock_guard<std::mutex> lock(mutex_);
  pencil_.admit(outline);
  Drawing drawing;
  pencil_.draw(outline, {0, 0, 0, 0}, drawing);
  walls_.add(drawing, tree);
}

int Cells::add(Outline outline, int tree) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const double reach = pencil_.admit(outline);
  const int number = static_cast<int>(bodies_.size());
  bodies_.push_back(
      {std::move(outline), reach, tree, true, {0, 0, 0, 0}, std::vector<Sheet>(shelves_.size())});
  for (std::size_t layer = 0; layer < shelves_.size(); ++layer) put(number, layer, {0, 0, 0, 0});
  return number;
}

void Cells::remove(int body) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requireKnown({body});
  pencil_.dismiss(at(body).outline);
  for (std::size_t layer = 0; layer < shelves_.size(); ++layer) shelve(body, layer, {});
  at(body) = {{}, 0, 0, false, {}, {}};
}

void Cells::requireKnown(const std::vector<int>& bodies) const {
  for (const int body : bodies) {
    if (body < 0 || static_cast<std::size_t>(body) >= bodies_.size() || !at(body).present)
      throw std::invalid_argument("there is no body " + std::to_string(body));
  }
}

void Cells::requirePoses(const std::vector<int>& bodies, const Pose* poses) const {
  requireKnown(bodies);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (!pencil_.numbered(poses[i], at(bodies[i]).reach))
      throw std::invalid_argument("pose " + std::to_string(i) + " is not finite, or beyond 2^30 cells");
  }
}

std::size_t Cells::layerOf(int layer) const {
  if (layer < 0 || static_cast<std::size_t>(layer) >= shelves_.size())
    throw std::invalid_argument("there is no layer " + std::to_string(layer));
  return (layer_ + static_cast<std::size_t>(layer)) % shelves_.size();
}

void Cells::setPoses(const std::vector<int>& bodies, const Pose* poses) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requirePoses(bodies, poses);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    at(bodies[i]).pose = poses[i];
    for (std::size_t layer = 0; layer < shelves_.size(); ++layer) put(bodies[i], layer, poses[i]);
  }
}

void Cells::turn() {
  const std::lock_guard<std::mutex> lock(mutex_);
  layer_ = (layer_ + 1) % shelves_.size();
}

void Cells::drawn(const std::vector<int>& bodies, int layer, Pose* poses) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requireKnown(bodies);
  const std::size_t which = layerOf(layer);
  for (std::size_t i = 0; i < bodies.size(); ++i) poses[i] = at(bodies[i]).sheets[which].pose;
}

void Cells::draw(const std::vector<int>& bodies, int layer, const Pose* poses) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requirePoses(bodies, poses);
  const std::size_t which = layerOf(layer);
  for (std::size_t i = 0; i < bodies.size(); ++i) put(bodies[i], which, poses[i]);
}

void Cells::put(int body, std::size_t layer, const Pose& pose) {
  Body& b = at(body);
  Sheet& sheet = b.sheets[layer];
  sheet.pose = pose;
  pencil_.draw(b.outline, pose, sheet.drawing);
  if (sheet.tiles != sheet.drawing.tiles) shelve(body, layer, sheet.drawing.tiles);
}

void Cells::shelve(int body, std::size_t layer, const std::vector<std::uint64_t>& tiles) {
  Shelf& shelf = shelves_[layer];
  std::vector<std::uint64_t>& old = at(body).sheets[layer].tiles;
  for (const std::uint64_t tile : old) {
    const auto found = shelf.find(tile);
    std::vector<int>& there = found->second;
    there.erase(std::find(there.begin(), there.end(), body));
    if (there.empty()) shelf.erase(found);
  }
  for (const std::uint64_t tile : tiles) shelf[tile].push_back(body);
  old = tiles;
}

void Cells::touches(const std::vector<int>& bodies, bool* out) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requireKnown(bodies);
  for (std::size_t i = 0; i < bodies.size(); ++i) out[i] = touches(bodies[i]);
}

bool Cells::touches(int body) const {
  const Drawing& drawing = at(body).sheets[layer_].drawing;
  return drawing.in_ground || walls_.meet(drawing, at(body).tree) || meetsBody(body);
}

bool Cells::meetsBody(int body) const {
  const Body& b = at(body);
  const Sheet& sheet = b.sheets[layer_];
  const Shelf& shelf = shelves_[layer_];
  return std::any_of(sheet.tiles.begin(), sheet.tiles.end(), [&](std::uint64_t tile) {
    const std::vector<int>& there = shelf.find(tile)->second;  // itself at least
    return std::any_of(there.begin(), there.end(), [&](int other) {
      return other != body && !related(at(other).tree, b.tree) &&
             meet(sheet.drawing, at(other).sheets[layer_].drawing);
    });
  });
}

void Cells::move(const std::vector<int>& bodies, const Pose* poses, const std::vector<int>& groups,
                 bool* stalled) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requirePoses(bodies, poses);
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < bodies.size(); begin = end) {
    end = begin + 1;
    while (!groups.empty() && end < bodies.size() && groups[end] == groups[begin]) ++end;
    std::fill(stalled + begin, stalled + end, !moveGroup(&bodies[begin], poses + begin, end - begin));
  }
}

bool Cells::moveGroup(const int* bodies, const Pose* poses, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) put(bodies[i], layer_, poses[i]);
  const bool free = std::none_of(bodies, bodies + count, [&](int body) { return touches(body); });
  for (std::size_t i = 0; i < count; ++i) {
    Body& body = at(bodies[i]);
    if (free) {
      body.pose = poses[i];
    } else {
      put(bodies[i], layer_, body.pose);
    }
  }
  return free;
}

}  // namespace kurumaisu
