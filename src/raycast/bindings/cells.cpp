// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core.Cells. Arrays are checked here for shape and kind, and by Cells for what they say.
#include "raycast/cells/cells.h"

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "bindings.h"
#include "raycast/bindings/arrays.h"
#include "raycast/bindings/mover_arrays.h"
#include "raycast/bindings/outline_arrays.h"

namespace kurumaisu {
namespace {

void addWalls(Cells& cells, const py::array& parents, const Array& places, const Array& edges,
              const py::array& parts, std::int64_t tree) {
  cells.addWalls(outlineOf(parents, places, edges, parts), asInt(tree, "tree"));
}

int addBody(Cells& cells, const py::array& parents, const Array& places, const Array& edges,
            const py::array& parts, std::int64_t tree) {
  return cells.add(outlineOf(parents, places, edges, parts), asInt(tree, "tree"));
}

Array drawn(Cells& cells, const py::array& bodies, std::int64_t layer) {
  const std::vector<int> which = integers(bodies, -1, "bodies");
  std::vector<Pose> poses(which.size());
  cells.drawn(which, asInt(layer, "layer"), poses.data());
  Array out({bodies.size(), py::ssize_t{4}});
  double* row = out.mutable_data();
  for (const Pose& pose : poses) {
    for (const double value : {pose.x, pose.y, pose.z, pose.heading}) *row++ = value;
  }
  return out;
}

void draw(Cells& cells, const py::array& bodies, std::int64_t layer, const Array& poses) {
  const std::vector<int> which = integers(bodies, -1, "bodies");
  cells.draw(which, asInt(layer, "layer"), posesOf(poses, bodies.size(), "poses").data());
}

}  // namespace

void bindCells(py::module_& m) {
  py::class_<Cells>(m, "Cells",
                    "Where bodies may go by Stage's rule: outlines collide where they share cells. Raises "
                    "ValueError naming what is wrong.")
      .def(py::init<double, int>(), py::arg("resolution"), py::arg("layers"),
           "resolution: edge of a cell [m]; layers: 1, or 2 that are drawn to in turn, as in Stage.")
      .def(
          "add_walls", &addWalls, py::arg("parents"), py::arg("places"), py::arg("edges"), py::arg("parts"),
          py::arg("tree"),
          "Add what stays. parents (p,): of each model, an earlier one, -1: the map; places (p, 9): pose in "
          "the "
          "parent's frame (4),\n"
          "height [m] on top of that, origin of the outline (4); edges (k, 6): from x, y to x, y, lowest and "
          "highest z [m]\n"
          "in the frame of the origin of their model, parts (k,); tree: the top-level model's number, "
          "negative: "
          "of none.")
      .def("add_body", &addBody, py::arg("parents"), py::arg("places"), py::arg("edges"), py::arg("parts"),
           py::arg("tree"),
           "Number of a new body in the map's origin; parent -1 is its frame, else like walls.")
      .def(
          "remove_body", [](Cells& cells, std::int64_t body) { cells.remove(asInt(body, "body")); },
          py::arg("body"), "Take a body away; its number stays unused.")
      .def("set_poses", &setPoses<Cells>, py::arg("bodies"), py::arg("poses"),
           "Put bodies (b,) to poses (b, 4): x, y, z [m], heading [rad] of their frames in the map.")
      .def("turn", &Cells::turn, "Begin a step: moves draw to the other layer from now on.")
      .def("touches", &touches<Cells>, py::arg("bodies"),
           "Whether bodies (b,) touch others, walls or the ground in the layer of this step.")
      .def("move", &move<Cells>, py::arg("bodies"), py::arg("poses"), py::arg("groups") = py::none(),
           "Move bodies (b,) in this order to poses (b, 4), each as a whole or not at all, neighbours of one "
           "group "
           "(b,) together;\n"
           "return which stalled (b,).")
      .def("drawn", &drawn, py::arg("bodies"), py::arg("layer"),
           "Poses (b, 4) at which bodies (b,) are in a layer; 0 is that of this step.")
      .def("draw", &draw, py::arg("bodies"), py::arg("layer"), py::arg("poses"),
           "Put bodies (b,) to poses (b, 4) in one layer.");
}

}  // namespace kurumaisu
