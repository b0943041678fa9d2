// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/cells/walls.h"

#include <algorithm>

namespace kurumaisu {
namespace {

constexpr std::uint32_t kMask = tiles::kSide - 1;

std::uint32_t columnIn(const Cell& cell) { return static_cast<std::uint32_t>(cell.x) & kMask; }
std::uint32_t rowIn(const Cell& cell) { return static_cast<std::uint32_t>(cell.y) & kMask; }
std::int32_t placeIn(const Cell& cell) {
  return static_cast<std::int32_t>(rowIn(cell) * tiles::kSide + columnIn(cell));
}

bool overlap(const std::tuple<double, double, int>& one, const std::tuple<double, double, int>& other) {
  return std::get<0>(one) <= std::get<1>(other) && std::get<1>(one) >= std::get<0>(other) &&
         !related(std::get<2>(one), std::get<2>(other));
}

}  // namespace

std::int32_t WallCells::kindOf(const Kind& kind) {
  const auto found = known_.emplace(kind, static_cast<std::int32_t>(kinds_.size()));
  if (found.second) kinds_.push_back(kind);
  return found.first->second;
}

void WallCells::add(const Drawing& drawing, int tree) {
  std::uint64_t key = 0;
  Tile* last = nullptr;
  std::size_t i = 0;
  for (const Drawing::Stroke& stroke : drawing.strokes) {
    const std::int32_t kind = kindOf({stroke.z_low, stroke.z_high, tree});
    for (; i < stroke.end; ++i) {
      const Cell& cell = drawing.cells[i];
      if (last == nullptr || tiles::of(cell) != key) {
        key = tiles::of(cell);
        auto found = tiles_.find(key);
        if (found == tiles_.end()) found = tiles_.emplace(key, Tile{{}, kind, {}}).first;
        last = &found->second;
      }
      Tile& tile = *last;
      if (tile.kind != kind && tile.kind != kMixed) mix(tile);
      if (tile.kind == kMixed) mark(tile, placeIn(cell), kind);
      tile.rows[rowIn(cell)] |= std::uint64_t{1} << columnIn(cell);
    }
  }
}

void WallCells::mark(Tile& tile, std::int32_t place, std::int32_t kind) {
  const auto before = [](const Mark& a, const Mark& b) {
    return std::tie(a.place, a.kind) < std::tie(b.place, b.kind);
  };
  const Mark mark{place, kind};
  const auto at = std::lower_bound(tile.marks.begin(), tile.marks.end(), mark, before);
  if (at == tile.marks.end() || before(mark, *at)) tile.marks.insert(at, mark);
}

void WallCells::mix(Tile& tile) {
  for (std::int32_t place = 0; place < tiles::kSide * tiles::kSide; ++place) {
    const auto row = static_cast<std::size_t>(place / tiles::kSide);
    if ((tile.rows[row] >> static_cast<unsigned>(place % tiles::kSide)) & 1U)
      tile.marks.push_back({place, tile.kind});
  }
  tile.kind = kMixed;
}

bool WallCells::meet(const Drawing& drawing, int tree) const {
  std::uint64_t key = 0;
  const Tile* tile = nullptr;
  std::size_t i = 0;
  for (const Drawing::Stroke& stroke : drawing.strokes) {
    const Kind kind{stroke.z_low, stroke.z_high, tree};
    for (; i < stroke.end; ++i) {
      const Cell& cell = drawing.cells[i];
      if (i == 0 || tiles::of(cell) != key) {
        key = tiles::of(cell);
        const auto found = tiles_.find(key);
        tile = found == tiles_.end() ? nullptr : &found->second;
      }
      if (tile == nullptr || ((tile->rows[rowIn(cell)] >> columnIn(cell)) & 1U) == 0) continue;
      if (meet(*tile, placeIn(cell), kind)) return true;
    }
  }
  return false;
}

bool WallCells::meet(const Tile& tile, std::int32_t place, const Kind& kind) const {
  if (tile.kind != kMixed) return overlap(kinds_[static_cast<std::size_t>(tile.kind)], kind);
  const auto first = std::lower_bound(tile.marks.begin(), tile.marks.end(), place,
                                      [](const Mark& mark, std::int32_t at) { return mark.place < at; });
  for (auto mark = first; mark != tile.marks.end() && mark->place == place; ++mark)
    if (overlap(kinds_[static_cast<std::size_t>(mark->kind)], kind)) return true;
  return false;
}

}  // namespace kurumaisu
