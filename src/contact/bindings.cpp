// SPDX-License-Identifier: BSD-3-Clause
// Clearance over numpy arrays; every pose and twist must be finite.
#include "contact/bindings.h"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>

#include "contact/clearance.h"

namespace py = pybind11;
namespace c = kurumaisu::contact;

namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Ints = py::array_t<int, py::array::c_style | py::array::forcecast>;

void requireShape(const Array& array, py::ssize_t rows, py::ssize_t columns, const char* what) {
  if (array.ndim() != 2 || array.shape(1) != columns || (rows >= 0 && array.shape(0) != rows)) {
    throw std::invalid_argument(std::string(what) + " must have " + std::to_string(columns) +
                                " columns and a row for each body");
  }
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    if (!std::isfinite(array.data()[i])) throw std::invalid_argument(std::string(what) + " must be finite");
  }
}

std::vector<c::Edge> edgesOf(const Array& array) {
  requireShape(array, -1, 6, "edges");
  std::vector<c::Edge> edges;
  const auto rows = array.unchecked<2>();
  edges.reserve(static_cast<std::size_t>(rows.shape(0)));
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    edges.push_back({{rows(i, 0), rows(i, 1)}, {rows(i, 2), rows(i, 3)}, rows(i, 4), rows(i, 5)});
  }
  return edges;
}

std::vector<c::Mover> moversOf(const c::Clearance& clearance, const Ints& bodies, const Array& poses,
                               const Array& twists, c::Frame frame) {
  requireShape(poses, bodies.size(), 4, "poses");
  requireShape(twists, bodies.size(), 3, "twists");
  std::vector<c::Mover> movers;
  movers.reserve(static_cast<std::size_t>(bodies.size()));
  const auto p = poses.unchecked<2>();
  const auto t = twists.unchecked<2>();
  for (py::ssize_t i = 0; i < bodies.size(); ++i) {
    movers.push_back(clearance.mover(bodies.at(i), {p(i, 0), p(i, 1), p(i, 2), p(i, 3)},
                                     {t(i, 0), t(i, 1), t(i, 2)}, frame));
  }
  return movers;
}

Array posesAt(const Array& poses, const Array& twists, double time) {
  requireShape(poses, -1, 4, "poses");
  requireShape(twists, poses.shape(0), 3, "twists");
  Array out({poses.shape(0), static_cast<py::ssize_t>(4)});
  const auto p = poses.unchecked<2>();
  const auto t = twists.unchecked<2>();
  auto to = out.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < poses.shape(0); ++i) {
    const c::Mover mover{
        nullptr, {p(i, 0), p(i, 1), p(i, 2), p(i, 3)}, {t(i, 0), t(i, 1), t(i, 2)}, c::Frame::body};
    const c::Pose pose = mover.at(time);
    to(i, 0) = pose.x;
    to(i, 1) = pose.y;
    to(i, 2) = pose.z;
    to(i, 3) = pose.heading;
  }
  return out;
}

c::Clearance makeClearance(const Array& array, const Ints& trees) {
  std::vector<c::Wall> walls;
  for (const c::Edge& edge : edgesOf(array)) {
    walls.push_back({edge, trees.at(static_cast<py::ssize_t>(walls.size()))});
  }
  return c::Clearance(std::move(walls));
}

std::tuple<py::array_t<double>, py::array_t<int>> freeTimes(const c::Clearance& clearance, const Ints& bodies,
                                                            const Array& poses, const Array& twists,
                                                            double limit, double distance) {
  const auto result =
      clearance.free(moversOf(clearance, bodies, poses, twists, c::Frame::body), limit, distance);
  py::array_t<int> pairs({static_cast<py::ssize_t>(result.pairs.size()), static_cast<py::ssize_t>(2)});
  for (std::size_t i = 0; i < result.pairs.size(); ++i) {
    pairs.mutable_at(i, 0) = result.pairs[i].first;
    pairs.mutable_at(i, 1) = result.pairs[i].second;
  }
  return {py::array_t<double>(static_cast<py::ssize_t>(result.times.size()), result.times.data()), pairs};
}

}  // namespace

void kurumaisu::bindContact(py::module_& m) {
  m.def("arcs", &posesAt, py::arg("poses"), py::arg("twists"), py::arg("time"),
        "Poses (n, 4) after a time [s] at constant twists (n, 3) in the body frame: forward, leftward [m/s], "
        "turn "
        "[rad/s].");
  py::class_<c::Clearance>(m, "Clearance", "How long bodies may move before they touch walls or each other.")
      .def(py::init(&makeClearance), py::arg("walls"), py::arg("trees"),
           "Walls (m, 6): ax, ay, bx, by, z_low, z_high [m], and the tree each belongs to.")
      .def(
          "add_body",
          [](c::Clearance& self, const Array& edges, int tree) { return self.add(edgesOf(edges), tree); },
          py::arg("edges"), py::arg("tree"), "Number of a new body of edges (k, 6) in its frame.")
      .def(
          "replace_body",
          [](c::Clearance& self, int body, const Array& edges) { self.replace(body, edgesOf(edges)); },
          py::arg("body"), py::arg("edges"), "Give a body other edges (k, 6).")
      .def("free_times", &freeTimes, py::arg("bodies"), py::arg("poses"), py::arg("twists"), py::arg("limit"),
           py::arg("distance"),
           "Times (n,) [s] until each body, all driving their arcs, is within a distance [m] of anything, or "
           "limit;\n"
           "and pairs (p, 2) of rows that could meet.")
      .def(
          "first_touch",
          [](const c::Clearance& self, const Ints& bodies, const Array& poses, const Array& velocities,
             double known, double distance, double give, double limit) {
            return self.firstTouch(moversOf(self, bodies, poses, velocities, c::Frame::map),
                                   {known, distance, give}, limit);
          },
          py::arg("bodies"), py::arg("poses"), py::arg("velocities"), py::kw_only(), py::arg("known"),
          py::arg("distance"), py::arg("give"), py::arg("limit"),
          "First time [s] at which a corner that is farther than known [m] from an edge comes within a "
          "distance of\n"
          "it, or a nearer one comes nearer by give; or limit. Velocities (n, 3) are in the map's frame.")
      .def(
          "near",
          [](const c::Clearance& self, const Ints& bodies, const Array& poses, double reach) {
            const Array still(std::vector<py::ssize_t>{poses.shape(0), 3},
                              std::vector<double>(static_cast<std::size_t>(poses.shape(0)) * 3, 0.0).data());
            return self.near(moversOf(self, bodies, poses, still, c::Frame::map), reach);
          },
          py::arg("bodies"), py::arg("poses"), py::arg("reach"),
          "Indices of walls within reach [m], rising.");
}
