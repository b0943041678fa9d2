// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core.CellRays. Arrays are checked here for shape and kind, and by CellRays for what they say.
#include <cstdint>
#include <utility>
#include <vector>

#include "bindings.h"
#include "raycast/bindings/beam_arrays.h"
#include "raycast/bindings/outline_arrays.h"
#include "raycast/cells/rays.h"

namespace kurumaisu {
namespace {

int add(CellRays& rays, const py::array& parents, const Array& places, const Array& edges,
        const py::array& parts, const Array& returns, std::int64_t tree) {
  requireLength(returns, parents.size(), "returns");
  std::vector<double> values(returns.data(), returns.data() + returns.size());
  return rays.add(outlineOf(parents, places, edges, parts), std::move(values), asInt(tree, "tree"));
}

void setThingPoses(CellRays& rays, const py::array& bodies, const Array& poses) {
  const std::vector<int> which = integers(bodies, -1, "bodies");
  const std::vector<Pose> where = posesOf(poses, bodies.size(), "poses");
  const py::gil_scoped_release release;
  rays.setPoses(which, where.data());
}

}  // namespace

void bindCellRays(py::module_& m) {
  py::class_<CellRays>(
      m, "CellRays",
      "What rangers see in cells, as Stage computes it. Raises ValueError naming what is wrong.")
      .def(py::init<double, int>(), py::arg("resolution"), py::arg("threads"),
           "resolution: edge of a cell [m].")
      .def("add", &add, py::arg("parents"), py::arg("places"), py::arg("edges"), py::arg("parts"),
           py::arg("returns"), py::arg("tree"),
           "Number of a new thing in the map's origin; outlines as of Cells.add_walls; returns (p,): ranger "
           "return of each model.")
      .def("set_poses", &setThingPoses, py::arg("bodies"), py::arg("poses"),
           "Put things (b,) to poses (b, 4): x, y, z [m], heading [rad] of their frames in the map.")
      .def("scan", &scan<CellRays>, py::arg("origins"), py::arg("trees"), py::arg("fans"),
           "Ranges [m] and ranger returns as of Arena.scan.")
      .def("cast", &cast<CellRays>, py::arg("origins"), py::arg("trees"), py::arg("range_max"),
           "Ranges [m] and ranger returns as of Arena.cast.");
}

}  // namespace kurumaisu
