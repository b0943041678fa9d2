// SPDX-License-Identifier: BSD-3-Clause
// numpy's arrays to beams, and back to arrays what a ray caster says of them.
#pragma once

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include "raycast/bindings/arrays.h"
#include "raycast/sight.h"

namespace kurumaisu {

inline std::vector<Viewpoint> viewpointsOf(const Array& origins, const py::array& trees) {
  const std::vector<Pose> poses = posesOf(origins, -1, "origins");
  const std::vector<int> own = integers(trees, origins.shape(0), "trees");
  std::vector<Viewpoint> from;
  from.reserve(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) from.push_back({poses[i], own[i]});
  return from;
}

inline std::vector<Beams> fansOf(const Array& array, py::ssize_t n) {
  const double* row = rowsOf(array, n, 4, "fans");
  std::vector<Beams> fans;
  fans.reserve(static_cast<std::size_t>(n));
  for (py::ssize_t i = 0; i < n; ++i, row += 4) {
    if (!(row[2] >= 0 && row[2] < 1e9 && row[2] == std::floor(row[2]))) {
      throw std::invalid_argument("fan " + std::to_string(i) +
                                  ": samples must be a whole number from 0, not " + std::to_string(row[2]));
    }
    fans.push_back({row[0], row[1], static_cast<std::size_t>(row[2]), row[3]});
  }
  return fans;
}

template <typename Caster>
py::tuple scan(Caster& caster, const Array& origins, const py::array& trees, const Array& fans) {
  const std::vector<Viewpoint> from = viewpointsOf(origins, trees);
  const std::vector<Beams> all = fansOf(fans, origins.shape(0));
  std::size_t total = 0;
  for (const Beams& fan : all) total += fan.samples;
  Array ranges(static_cast<py::ssize_t>(total));
  Array returns(static_cast<py::ssize_t>(total));
  double* range = ranges.mutable_data();
  double* value = returns.mutable_data();
  {
    const py::gil_scoped_release release;
    caster.scan(from, all, range, value);
  }
  return py::make_tuple(ranges, returns);
}

template <typename Caster>
py::tuple cast(Caster& caster, const Array& origins, const py::array& trees, double range_max) {
  const std::vector<Viewpoint> from = viewpointsOf(origins, trees);
  Array ranges(origins.shape(0));
  Array returns(origins.shape(0));
  double* range = ranges.mutable_data();
  double* value = returns.mutable_data();
  {
    const py::gil_scoped_release release;
    caster.cast(from, range_max, range, value);
  }
  return py::make_tuple(ranges, returns);
}

}  // namespace kurumaisu
