// SPDX-License-Identifier: BSD-3-Clause
// Which things are drawn in which cells.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "raycast/cells/drawing.h"
#include "raycast/cells/ray.h"

namespace kurumaisu {

/// Cells in regions, each cell with the strokes that are drawn in it, in the order in which they were.
class Regions {
 public:
  struct Mark {
    std::int32_t thing;
    std::int32_t stroke;  ///< of the thing's drawing
    std::int32_t next;    ///< mark in the same cell, -1: this is the last
  };
  struct Region {
    std::int64_t marks;
    std::array<std::int32_t, static_cast<std::size_t>(regions::kSide) * regions::kSide> first;  ///< -1: none
  };

  void add(const Drawing& drawing, std::int32_t thing);

  /// Takes out what was added.
  void remove(const Drawing& drawing, std::int32_t thing);

  /// The region of a cell, null if it is empty.
  const Region* at(const Cell& cell) const {
    const auto found = regions_.find(regions::of(cell));
    return found == regions_.end() || found->second.marks == 0 ? nullptr : &found->second;
  }

  /// The first mark in a cell of a region, -1: none.
  static std::int32_t first(const Region& region, const Cell& cell) { return region.first[placeOf(cell)]; }
  const Mark& mark(std::int32_t number) const { return marks_[static_cast<std::size_t>(number)]; }

 private:
  static std::size_t placeOf(const Cell& cell) {
    const std::uint32_t column = static_cast<std::uint32_t>(cell.x) & regions::kMask;
    const std::uint32_t row = static_cast<std::uint32_t>(cell.y) & regions::kMask;
    return row * regions::kSide + column;
  }
  Mark& mark(std::int32_t number) { return marks_[static_cast<std::size_t>(number)]; }
  std::int32_t made(const Mark& mark);

  template <typename Visit>
  void eachCell(const Drawing& drawing, const Visit& visit);

  std::unordered_map<std::uint64_t, Region> regions_;
  std::vector<Mark> marks_;
  std::int32_t unused_ = -1;  ///< mark to use again, and so on along next
};

}  // namespace kurumaisu
