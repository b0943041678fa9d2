// SPDX-License-Identifier: BSD-3-Clause
// The walls that a beam can meet, by its height and its own tree.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "raycast/bodies.h"
#include "raycast/scene.h"

namespace kurumaisu {

struct Wall {
  Face face;  ///< in the map frame
  int tree;
};

/// Some of the walls as a scene; members: the wall of each of its segments.
struct Layer {
  std::vector<std::int32_t> members;
  Scene scene;
};

/// Scenes made when they are first asked for. Heights between which no wall begins or ends share theirs.
class Layers {
 public:
  /// The walls must outlive it.
  explicit Layers(const std::vector<Wall>& walls);

  /// The layer that beams at height z [m] of a sensor of a tree see; it stays where it is.
  const Layer& at(double z, int tree);

 private:
  const Layer& make(double z, int without);

  const std::vector<Wall>& walls_;
  std::vector<double> bounds_;  ///< heights where walls begin or end, sorted [m]
  std::vector<int> owners_;     ///< trees that have walls, sorted
  std::map<std::pair<std::size_t, int>, const Layer*> known_;
  std::vector<std::unique_ptr<Layer>> layers_;
};

}  // namespace kurumaisu
