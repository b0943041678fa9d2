// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/cells/regions.h"

namespace kurumaisu {

template <typename Visit>
void Regions::eachCell(const Drawing& drawing, const Visit& visit) {
  std::uint64_t key = 0;
  Region* region = nullptr;
  std::size_t i = 0;
  std::int32_t stroke = 0;
  for (const Drawing::Stroke& cells : drawing.strokes) {
    for (; i < cells.end; ++i) {
      const Cell& cell = drawing.cells[i];
      if (region == nullptr || regions::of(cell) != key) {
        key = regions::of(cell);
        const auto found = regions_.try_emplace(key);
        region = &found.first->second;
        if (found.second) {
          region->marks = 0;
          region->first.fill(-1);
        }
      }
      visit(*region, &region->first[placeOf(cell)], stroke);
    }
    ++stroke;
  }
}

void Regions::add(const Drawing& drawing, std::int32_t thing) {
  eachCell(drawing, [&](Region& region, std::int32_t* link, std::int32_t stroke) {
    const std::int32_t number = made({thing, stroke, -1});
    for (std::int32_t at = *link; at >= 0; at = mark(at).next) link = &mark(at).next;
    *link = number;
    ++region.marks;
  });
}

void Regions::remove(const Drawing& drawing, std::int32_t thing) {
  eachCell(drawing, [&](Region& region, std::int32_t* link, std::int32_t stroke) {
    while (mark(*link).thing != thing || mark(*link).stroke != stroke) link = &mark(*link).next;
    const std::int32_t number = *link;
    *link = mark(number).next;
    mark(number).next = unused_;
    unused_ = number;
    --region.marks;
  });
}

std::int32_t Regions::made(const Mark& mark) {
  if (unused_ < 0) {
    marks_.push_back(mark);
    return static_cast<std::int32_t>(marks_.size()) - 1;
  }
  const std::int32_t number = unused_;
  unused_ = this->mark(number).next;
  this->mark(number) = mark;
  return number;
}

}  // namespace kurumaisu
