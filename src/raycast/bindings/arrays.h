// SPDX-License-Identifier: BSD-3-Clause
// numpy's arrays to what the ray caster's classes take, shapes and kinds checked.
#pragma once

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "bindings.h"
#include "raycast/bodies.h"

namespace kurumaisu {
namespace py = pybind11;

using Bools = py::array_t<bool, py::array::c_style | py::array::forcecast>;

/// Rows of an array (n, columns), n as asked for or -1: any.
inline const double* rowsOf(const Array& array, py::ssize_t n, py::ssize_t columns, const std::string& name) {
  if (array.ndim() == 2 && array.shape(1) == columns && (n < 0 || array.shape(0) == n)) return array.data();
  const std::string rows = n < 0 ? "n" : std::to_string(n);
  throw std::invalid_argument(name + " must have shape (" + rows + ", " + std::to_string(columns) + ")");
}

template <typename A>
void requireLength(const A& array, py::ssize_t n, const char* name) {
  if (array.ndim() == 1 && (n < 0 || array.size() == n)) return;
  throw std::invalid_argument(std::string(name) + " must have shape (" + (n < 0 ? "n" : std::to_string(n)) +
                              ",)");
}

inline int asInt(std::int64_t value, const char* name) {
  if (value >= std::numeric_limits<int>::min() && value <= std::numeric_limits<int>::max())
    return static_cast<int>(value);
  throw std::invalid_argument(std::string(name) + ": " + std::to_string(value) + " is not a valid number");
}

/// Integers (n,); an array of another kind would be rounded by a cast.
inline std::vector<int> integers(const py::array& array, py::ssize_t n, const char* name) {
  requireLength(array, n, name);
  const char kind = array.dtype().kind();
  if (kind != 'i' && kind != 'u' && array.size() > 0)
    throw std::invalid_argument(std::string(name) + " must be integers");
  const py::array_t<std::int64_t, py::array::c_style | py::array::forcecast> values(array);
  std::vector<int> out;
  out.reserve(static_cast<std::size_t>(values.size()));
  for (py::ssize_t i = 0; i < values.size(); ++i) out.push_back(asInt(values.data()[i], name));
  return out;
}

inline std::vector<Pose> posesOf(const Array& array, py::ssize_t n, const char* name) {
  const double* row = rowsOf(array, n, 4, name);
  std::vector<Pose> poses;
  poses.reserve(static_cast<std::size_t>(array.shape(0)));
  for (py::ssize_t i = 0; i < array.shape(0); ++i, row += 4)
    poses.push_back({row[0], row[1], row[2], row[3]});
  return poses;
}

}  // namespace kurumaisu
