// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core: ray casting. Vectorised over numpy arrays.
#include "raycast/scene.h"

#include <pybind11/stl.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "bindings.h"

namespace kurumaisu {
namespace py = pybind11;
namespace {

std::vector<Segment> segmentsOf(const Array& array) {
  if (array.ndim() != 2 || array.shape(1) != 4)
    throw std::invalid_argument("segments must have shape (m, 4)");
  std::vector<Segment> segments;
  segments.reserve(static_cast<std::size_t>(array.shape(0)));
  const auto rows = array.unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    segments.push_back({rows(i, 0), rows(i, 1), rows(i, 2), rows(i, 3)});
  }
  return segments;
}

/// Poses (n, 3), or one pose (3,), of beams along bearings (n,).
std::vector<Pose2D> originsOf(const Array& poses, const Array& bearings) {
  if (bearings.ndim() != 1) throw std::invalid_argument("bearings must have shape (n,)");
  if (poses.ndim() > 2 || poses.ndim() < 1 || poses.shape(poses.ndim() - 1) != 3 ||
      (poses.ndim() == 2 && poses.shape(0) != bearings.size())) {
    throw std::invalid_argument("poses must have shape (3,), or (n, 3) with one row per bearing");
  }
  std::vector<Pose2D> origins;
  for (py::ssize_t i = 0; i < poses.size(); i += 3) {
    origins.push_back({poses.data()[i], poses.data()[i + 1], poses.data()[i + 2]});
  }
  return origins;
}

Array castBeams(const Scene& scene, const Array& poses, const Array& bearings, double max_range) {
  const std::vector<Pose2D> origins = originsOf(poses, bearings);
  if (!(max_range >= 0)) throw std::invalid_argument("max_range must not be negative");
  Array out(bearings.size());
  double* ranges = out.mutable_data();
  {
    const py::gil_scoped_release release;
    scene.cast(origins.data(), poses.ndim() == 1, bearings.data(), static_cast<std::size_t>(bearings.size()),
               max_range, ranges);
  }
  return out;
}

py::tuple tupleOf(const std::vector<Hit>& hits) {
  Array ranges(static_cast<py::ssize_t>(hits.size()));
  py::array_t<std::int64_t> segments(static_cast<py::ssize_t>(hits.size()));
  double* range = ranges.mutable_data();
  std::int64_t* segment = segments.mutable_data();
  for (const Hit& hit : hits) {
    *range++ = hit.range;
    *segment++ = hit.segment;
  }
  return py::make_tuple(ranges, segments);
}

py::tuple meetBeams(const Scene& scene, const Array& poses, const Array& bearings) {
  const std::vector<Pose2D> origins = originsOf(poses, bearings);
  const auto n = static_cast<std::size_t>(bearings.size());
  std::vector<Hit> hits(n);
  {
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < n; ++i) {
      const Pose2D& pose = origins[origins.size() == 1 ? 0 : i];
      hits[i] = scene.cast(pose.x, pose.y, pose.theta + bearings.data()[i],
                           std::numeric_limits<double>::infinity());
    }
  }
  return tupleOf(hits);
}

py::tuple castFan(const Scene& scene, const std::array<double, 3>& origin, double first, double increment,
                  std::size_t samples, double max_range) {
  if (!(max_range >= 0)) throw std::invalid_argument("max_range must not be negative");
  std::vector<Hit> hits(samples);
  {
    const py::gil_scoped_release release;
    scene.castFan({origin[0], origin[1], origin[2]}, first, increment, samples, max_range, hits.data());
  }
  return tupleOf(hits);
}

}  // namespace

void bindRaycast(py::module_& m) {
  py::class_<Scene>(m, "Scene", "Immutable line segments that answer rays exactly.")
      .def(py::init([](const Array& segments) { return Scene(segmentsOf(segments)); }), py::arg("segments"),
           "From segments (m, 4): x, y of both ends [m]. Raises ValueError for one that is not finite.")
      .def("__len__", &Scene::size)
      .def("cast", &castBeams, py::arg("poses"), py::arg("bearings"), py::arg("max_range"),
           "Ranges (n,) [m] of beams that leave poses (n, 3), or one pose (3,), at bearings (n,) [rad]; +inf "
           "beyond\n"
           "max_range [m]. Poses are of the laser, in the map frame.")
      .def("meet", &meetBeams, py::arg("poses"), py::arg("bearings"),
           "Ranges (n,) [m] as of cast, at any distance, and the segments (n,) that are met; -1: nothing.")
      .def("cast_fan", &castFan, py::arg("origin"), py::arg("first"), py::arg("increment"),
           py::arg("samples"), py::arg("max_range"),
           "Ranges (samples,) [m] and indices (samples,) of the segments met; +inf and -1: nothing within "
           "max_range\n"
           "[m]. Beam i leaves the origin (3,) at bearing first + i * increment [rad].");
  bindArena(m);
  bindCells(m);
  bindCellRays(m);
}

}  // namespace kurumaisu
