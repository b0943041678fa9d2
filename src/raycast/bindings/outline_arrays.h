// SPDX-License-Identifier: BSD-3-Clause
// numpy's arrays to outlines that are drawn into cells.
#pragma once

#include <vector>

#include "raycast/bindings/arrays.h"
#include "raycast/cells/drawing.h"

namespace kurumaisu {

inline Outline outlineOf(const py::array& parents, const Array& places, const Array& edges,
                         const py::array& parts) {
  constexpr py::ssize_t kPlace = 9;  // columns of a part's places
  Outline out;
  const std::vector<int> parent = integers(parents, -1, "parents");
  const double* p = rowsOf(places, parents.size(), kPlace, "places");
  for (const int below : parent) {
    out.parts.push_back({below, {p[0], p[1], p[2], p[3]}, p[4], {p[5], p[6], p[7], p[8]}});
    p += kPlace;
  }
  const std::vector<int> part = integers(parts, -1, "parts");
  const double* e = rowsOf(edges, parts.size(), 6, "edges");
  for (const int of : part) {
    out.edges.push_back({{e[0], e[1], e[2], e[3]}, e[4], e[5], of});
    e += 6;
  }
  return out;
}

}  // namespace kurumaisu
