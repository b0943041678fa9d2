// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core.Arena. Arrays are checked here for shape and kind, and by the arena for what they say.
#include "raycast/arena.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bindings.h"
#include "raycast/bindings/arrays.h"
#include "raycast/bindings/beam_arrays.h"
#include "raycast/bindings/mover_arrays.h"
#include "raycast/bindings/step.h"

namespace kurumaisu {
namespace py = pybind11;
namespace {

std::vector<Face> facesOf(const Array& outline, const Array& returns, const Bools& solid, const char* name) {
  const double* row = rowsOf(outline, -1, 6, name);
  const py::ssize_t n = outline.shape(0);
  requireLength(returns, n, "returns");
  requireLength(solid, n, "solid");
  std::vector<Face> faces;
  faces.reserve(static_cast<std::size_t>(n));
  for (py::ssize_t i = 0; i < n; ++i, row += 6) {
    faces.push_back({{row[0], row[1], row[2], row[3]}, row[4], row[5], returns.data()[i], solid.data()[i]});
  }
  return faces;
}

std::unique_ptr<Arena> makeArena(const Array& walls, const Array& returns, const Bools& solid,
                                 const py::array& tree, int threads) {
  const std::vector<Face> faces = facesOf(walls, returns, solid, "walls");
  const std::vector<int> trees = integers(tree, walls.shape(0), "tree");
  std::vector<Wall> all;
  all.reserve(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) all.push_back({faces[i], trees[i]});
  return std::make_unique<Arena>(std::move(all), threads);
}

double* put(const Pose& pose, double* row) {
  for (const double value : {pose.x, pose.y, pose.z, pose.heading}) *row++ = value;
  return row;
}

Array stepAll(const Array& poses, const Array& velocities, double dt) {
  const double* p = rowsOf(poses, -1, 4, "poses");
  const double* v = rowsOf(velocities, poses.shape(0), 3, "velocities");
  Array out({poses.shape(0), py::ssize_t{4}});
  double* row = out.mutable_data();
  for (py::ssize_t i = 0; i < poses.shape(0); ++i, p += 4, v += 3)
    row = put(stepped({p[0], p[1], p[2], p[3]}, {v[0], v[1], v[2]}, dt), row);
  return out;
}

Array mountAll(const Array& frames, const py::array& bodies, const Array& mounts) {
  const std::vector<Pose> bases = posesOf(frames, -1, "frames");
  const std::vector<int> below = integers(bodies, -1, "bodies");
  const double* m = rowsOf(mounts, bodies.size(), 4, "mounts");
  Array out({bodies.size(), py::ssize_t{4}});
  double* row = out.mutable_data();
  const auto count = static_cast<int>(bases.size());
  for (const int body : below) {
    if (body < -count || body >= count)
      throw std::invalid_argument("there is no frame " + std::to_string(body));
    const int place = body < 0 ? body + count : body;
    row = put(mounted(bases[static_cast<std::size_t>(place)], {m[0], m[1], m[2], m[3]}), row);
    m += 4;
  }
  return out;
}

}  // namespace

void bindArena(py::module_& m) {
  m.def("mounted", &mountAll, py::arg("frames"), py::arg("bodies"), py::arg("mounts"),
        "Poses (f, 4) in the map of what is at mounts (f, 4) in frames (b, 4), by their rows bodies (f,); -1 "
        "is the last.");
  m.def("step", &stepAll, py::arg("poses"), py::arg("velocities"), py::arg("dt"),
        "Poses (b, 4) that bodies would have after dt [s] from poses (b, 4) with velocities (b, 3): forward, "
        "leftward [m/s], turn [rad/s], along the old headings, as in Stage.");
  py::class_<Arena>(
      m, "Arena",
      "Walls that stay and bodies that move, for many sensors. Results are the same for any number "
      "of threads.\n"
      "Raises ValueError naming what is wrong; nothing has changed then.")
      .def(py::init(&makeArena), py::arg("walls"), py::arg("returns"), py::arg("solid"), py::arg("tree"),
           py::arg("threads"),
           "From walls (m, 6): x, y of both ends, lowest and highest z [m]; returns (m,): ranger return, "
           "below 0 "
           "invisible;\n"
           "solid (m,); tree (m,): number of the top-level model, negative: of none.")
      .def(
          "add_body",
          [](Arena& arena, const Array& outline, const Array& returns, const Bools& solid,
             std::int64_t tree) {
            return arena.add(facesOf(outline, returns, solid, "outline"), asInt(tree, "tree"));
          },
          py::arg("outline"), py::arg("returns"), py::arg("solid"), py::arg("tree"),
          "Number of a new rigid body in the map's origin; outline (k, 6) in its frame, else like walls.")
      .def(
          "remove_body", [](Arena& arena, std::int64_t body) { arena.remove(asInt(body, "body")); },
          py::arg("body"), "Take a body away; its number stays unused.")
      .def("set_poses", &setPoses<Arena>, py::arg("bodies"), py::arg("poses"),
           "Put bodies (b,) to poses (b, 4): x, y, z [m], heading [rad] of their frames in the map.")
      .def(
          "scan", &scan<Arena>, py::arg("origins"), py::arg("trees"), py::arg("fans"),
          "Ranges [m] and ranger returns, (sum of samples,) each, of fans (s, 4): first bearing, increment "
          "[rad], samples,\n"
          "range_max [m], from origins (s, 4): x, y, z [m], heading [rad], blind for their own trees (s,). A "
          "miss is +inf and 0.")
      .def("cast", &cast<Arena>, py::arg("origins"), py::arg("trees"), py::arg("range_max"),
           "Ranges [m] and ranger returns (n,) of single rays from origins (n, 4): x, y, z [m], direction "
           "[rad].")
      .def("touches", &touches<Arena>, py::arg("bodies"),
           "Whether solid outlines of bodies (b,) touch solid outlines of other trees at common heights, or "
           "the "
           "ground.")
      .def("move", &move<Arena>, py::arg("bodies"), py::arg("poses"), py::arg("groups") = py::none(),
           "Move bodies (b,) in this order to poses (b, 4), each as a whole or not at all; return which "
           "stalled "
           "(b,).\n"
           "Outlines are hollow and only the end of the way counts, as in Stage. groups (b,): neighbours of "
           "the "
           "same number\n"
           "go together or not at all.");
}

}  // namespace kurumaisu
