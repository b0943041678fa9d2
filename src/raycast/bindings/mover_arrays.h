// SPDX-License-Identifier: BSD-3-Clause
// What Arena and Cells share towards numpy: bodies that are put, felt and moved.
#pragma once

#include <vector>

#include "raycast/bindings/arrays.h"

namespace kurumaisu {

template <typename Ground>
void setPoses(Ground& ground, const py::array& bodies, const Array& poses) {
  const std::vector<int> which = integers(bodies, -1, "bodies");
  const std::vector<Pose> where = posesOf(poses, bodies.size(), "poses");
  const py::gil_scoped_release release;
  ground.setPoses(which, where.data());
}

template <typename Ground>
Bools touches(Ground& ground, const py::array& bodies) {
  const std::vector<int> which = integers(bodies, -1, "bodies");
  Bools out(bodies.size());
  bool* touching = out.mutable_data();
  {
    const py::gil_scoped_release release;
    ground.touches(which, touching);
  }
  return out;
}

template <typename Ground>
Bools move(Ground& ground, const py::array& bodies, const Array& poses, const py::object& groups) {
  const std::vector<int> which = integers(bodies, -1, "bodies");
  const std::vector<Pose> where = posesOf(poses, bodies.size(), "poses");
  std::vector<int> together;
  if (!groups.is_none()) together = integers(py::array(groups), bodies.size(), "groups");
  Bools out(bodies.size());
  bool* stalled = out.mutable_data();
  {
    const py::gil_scoped_release release;
    ground.move(which, where.data(), together, stalled);
  }
  return out;
}

}  // namespace kurumaisu
