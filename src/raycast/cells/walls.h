// SPDX-License-Identifier: BSD-3-Clause
// Cells of what never moves: a bit each, and heights and trees where they differ within a tile.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "raycast/cells/drawing.h"

namespace kurumaisu {

class WallCells {
 public:
  void add(const Drawing& drawing, int tree);

  /// Whether a drawing of a tree has a cell of another tree's wall at common heights.
  bool meet(const Drawing& drawing, int tree) const;

 private:
  using Kind = std::tuple<double, double, int>;  ///< z_low, z_high [m], tree

  /// One kind in one cell.
  struct Mark {
    std::int32_t place;  ///< of the cell in its tile
    std::int32_t kind;
  };
  struct Tile {
    std::array<std::uint64_t, tiles::kSide> rows;  ///< a bit for each cell
    std::int32_t kind;                             ///< of all its cells; kMixed: see the marks
    std::vector<Mark> marks;                       ///< sorted
  };
  static constexpr std::int32_t kMixed = -1;

  std::int32_t kindOf(const Kind& kind);
  static void mark(Tile& tile, std::int32_t place, std::int32_t kind);
  static void mix(Tile& tile);
  bool meet(const Tile& tile, std::int32_t place, const Kind& kind) const;

  std::unordered_map<std::uint64_t, Tile> tiles_;
  std::vector<Kind> kinds_;
  std::map<Kind, std::int32_t> known_;
};

}  // namespace kurumaisu
