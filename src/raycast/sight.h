// SPDX-License-Identifier: BSD-3-Clause
// What beams see of bodies that move.
#pragma once

#include <cstddef>

#include "raycast/beams.h"
#include "raycast/bodies.h"
#include "raycast/ray.h"

namespace kurumaisu {

/// Where beams leave, and the tree whose bodies they do not see.
struct Viewpoint {
  Pose pose;  ///< z: of the beams' plane
  int tree;
};

/// The nearest thing on a beam so far: range [m], +inf for nothing, and the ranger return of what is there.
struct Echo {
  double range;
  double ranger_return;
};

/// Puts the bodies in the way of a fan's beams; echoes (samples): what the beams meet without them.
void seeBodies(const Bodies& bodies, const Viewpoint& from, const Beams& fan, Echo* echoes);

/// Puts the bodies in the way of single rays along the headings; echoes (n): what they meet without them.
void seeBodies(const Bodies& bodies, const Viewpoint* from, std::size_t n, double range_max, Echo* echoes);

}  // namespace kurumaisu
