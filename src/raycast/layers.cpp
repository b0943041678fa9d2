// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/layers.h"

#include <algorithm>

namespace kurumaisu {
namespace {

template <typename T>
void sortUnique(std::vector<T>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

}  // namespace

Layers::Layers(const std::vector<Wall>& walls) : walls_(walls) {
  for (const Wall& wall : walls) {
    if (wall.face.ranger_return < 0) continue;
    bounds_.push_back(wall.face.z_low);
    bounds_.push_back(wall.face.z_high);
    if (wall.tree >= 0) owners_.push_back(wall.tree);
    if (bounds_.size() > 4096) sortUnique(bounds_);  // thousands of walls have few heights
  }
  sortUnique(bounds_);
  sortUnique(owners_);
}

const Layer& Layers::at(double z, int tree) {
  const auto bound = std::lower_bound(bounds_.begin(), bounds_.end(), z);
  const auto below = 2 * static_cast<std::size_t>(bound - bounds_.begin());
  const std::size_t height = bound != bounds_.end() && *bound == z ? below + 1 : below;
  const int without = std::binary_search(owners_.begin(), owners_.end(), tree) ? tree : -1;
  const Layer*& layer = known_[{height, without}];
  if (layer == nullptr) layer = &make(z, without);
  return *layer;
}

const Layer& Layers::make(double z, int without) {
  std::vector<std::int32_t> members;
  std::vector<Segment> lines;
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    const Face& face = walls_[i].face;
    if (face.ranger_return < 0 || z < face.z_low || z > face.z_high) continue;
    if (related(walls_[i].tree, without)) continue;
    members.push_back(static_cast<std::int32_t>(i));
    lines.push_back(face.line);
  }
  for (const auto& layer : layers_)
    if (layer->members == members) return *layer;
  layers_.push_back(std::make_unique<Layer>(Layer{std::move(members), Scene(std::move(lines))}));
  return *layers_.back();
}

}  // namespace kurumaisu
