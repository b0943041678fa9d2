// SPDX-License-Identifier: BSD-3-Clause
// Points that give away whatever hides between two rays which meet the same wall.
#pragma once

#include <optional>
#include <vector>

#include "raycast/grid.h"

namespace kurumaisu {

struct Point {
  double x, y;  ///< [m]
};

/// One end of each set of segments that hang together by shared ends, and all points where segments touch
/// otherwise.
///
/// Let two rays from one origin first meet the same segment away from its ends. Whatever reaches into the triangle
/// between them cannot cross the rays. So it lies wholly inside, with its witness, or touches that segment at a
/// witness. A triangle without witnesses is empty.
/// None if so many segments share cells that to compare them would take longer than it saves.
std::optional<std::vector<Point>> findWitnesses(const std::vector<Segment>& segments, const Grid& grid);

}  // namespace kurumaisu
