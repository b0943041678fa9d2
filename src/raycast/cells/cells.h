// SPDX-License-Identifier: BSD-3-Clause
// Stage's collisions to the letter: outlines collide where they share cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "raycast/cells/drawing.h"
#include "raycast/cells/walls.h"

namespace kurumaisu {

/// Where bodies may go. Moves as Arena does, but outlines touch that have a cell in common, at common heights.
///
/// With two layers it remembers as Stage does: each step draws to one of them in turn and looks at that one only, so
/// a body that has not moved yet in this step, or rests since, is met where it was one step before.
///
/// Errors are std::invalid_argument, and nothing has changed then. One call at a time; others wait.
class Cells {
 public:
  /// resolution: edge of a cell [m]; layers: 1 or 2.
  Cells(double resolution, int layers);

  /// Solid outlines that stay, in the map frame.
  void addWalls(const Outline& outline, int tree);

  /// A body in the map's origin, at heading 0; returns its number.
  int add(Outline outline, int tree);
  void remove(int body);

  /// In all layers.
  void setPoses(const std::vector<int>& bodies, const Pose* poses);

  /// Begins a step: moves draw to the other layer from now on.
  void turn();

  /// Whether bodies touch others, walls or the ground in the layer of this step.
  void touches(const std::vector<int>& bodies, bool* out);

  /// In the order given each body goes to its pose as a whole, or stays if it would touch something there.
  ///
  /// Neighbours in the sequence with the same group go together or not at all; no groups: each on its own.
  void move(const std::vector<int>& bodies, const Pose* poses, const std::vector<int>& groups, bool* stalled);

  /// Poses at which bodies are drawn in a layer: 0 is that of this step.
  void drawn(const std::vector<int>& bodies, int layer, Pose* poses);

  /// Draws bodies in one layer only, wherever they are.
  void draw(const std::vector<int>& bodies, int layer, const Pose* poses);

 private:
  struct Sheet {
    Pose pose;
    Drawing drawing;
    std::vector<std::uint64_t> tiles;  ///< of the shelf, that it is in
  };
  struct Body {
    Outline outline;
    double reach;  ///< [m] from its frame
    int tree;
    bool present;
    Pose pose;
    std::vector<Sheet> sheets;  ///< of each layer
  };
  using Shelf = std::unordered_map<std::uint64_t, std::vector<int>>;

  Body& at(int body) { return bodies_[static_cast<std::size_t>(body)]; }
  const Body& at(int body) const { return bodies_[static_cast<std::size_t>(body)]; }
  std::size_t layerOf(int layer) const;
  void requireKnown(const std::vector<int>& bodies) const;
  void requirePoses(const std::vector<int>& bodies, const Pose* poses) const;
  void put(int body, std::size_t layer, const Pose& pose);
  void shelve(int body, std::size_t layer, const std::vector<std::uint64_t>& tiles);
  bool moveGroup(const int* bodies, const Pose* poses, std::size_t count);
  bool touches(int body) const;
  bool meetsBody(int body) const;

  std::mutex mutex_;
  Pencil pencil_;
  WallCells walls_;
  std::vector<Body> bodies_;
  std::vector<Shelf> shelves_;  ///< of each layer: bodies by the tiles they have cells in
  std::size_t layer_ = 0;       ///< of this step
};

}  // namespace kurumaisu
