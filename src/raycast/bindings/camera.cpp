// SPDX-License-Identifier: BSD-3-Clause
// The camera's part of kurumaisu._core.
#include "raycast/camera/camera.h"

#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

#include "bindings.h"

namespace kurumaisu {
namespace py = pybind11;
namespace {

using Indices = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;
using Colors = py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>;
using Flags = py::array_t<bool, py::array::c_style | py::array::forcecast>;

struct Panels {
  std::vector<Panel> panels;
  std::int32_t bodies;  ///< more than the highest body
};

void requireShape(const py::array& array, py::ssize_t rows, py::ssize_t columns, const char* name) {
  const bool fits = columns ? array.ndim() == 2 && array.shape(0) == rows && array.shape(1) == columns
                            : array.ndim() == 1 && array.shape(0) == rows;
  if (!fits) throw std::invalid_argument(std::string(name) + " has a wrong shape");
}

void requireFinite(const Array& array, const char* name) {
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    if (!std::isfinite(array.data()[i])) throw std::invalid_argument(std::string(name) + " is not finite");
  }
}

std::uint32_t pack(const std::uint8_t* bytes) {
  std::uint32_t color = 0;
  std::memcpy(&color, bytes, sizeof color);
  return color;
}

Panels makePanels(const Array& walls, const Colors& colors, const Indices& prisms, const Indices& bodies) {
  const py::ssize_t n = walls.ndim() == 2 ? walls.shape(0) : 0;
  requireShape(walls, n, 6, "walls");
  requireShape(colors, n, 4, "colors");
  requireShape(prisms, n, 0, "prisms");
  requireShape(bodies, n, 0, "bodies");
  requireFinite(walls, "walls");
  Panels out{{}, 0};
  for (py::ssize_t i = 0; i < n; ++i) {
    const double* w = walls.data(i, 0);
    const std::int32_t body = bodies.at(i);
    if (body < 0) throw std::invalid_argument("bodies must not be negative");
    out.panels.push_back({w[0], w[1], w[2], w[3], w[4], w[5], pack(colors.data(i, 0)), prisms.at(i), body});
    out.bodies = std::max(out.bodies, body + 1);
  }
  return out;
}

py::tuple render(Camera& camera, const Panels& panels, const Array& poses, const Flags& hidden,
                 const Array& eye, const Colors& ground, const Colors& sky) {
  const py::ssize_t n = poses.ndim() == 2 ? poses.shape(0) : 0;
  requireShape(poses, n, 4, "poses");
  requireShape(hidden, n, 0, "hidden");
  requireShape(eye, 4, 0, "eye");
  requireShape(ground, 4, 0, "ground");
  requireShape(sky, 4, 0, "sky");
  requireFinite(poses, "poses");
  requireFinite(eye, "eye");
  if (n < panels.bodies) throw std::invalid_argument("poses has fewer rows than there are bodies");
  std::vector<Pose> stands;
  stands.reserve(static_cast<std::size_t>(n));
  for (py::ssize_t i = 0; i < n; ++i) {
    stands.push_back({poses.at(i, 0), poses.at(i, 1), poses.at(i, 2), poses.at(i, 3)});
  }
  const std::vector<char> unseen(hidden.data(), hidden.data() + n);
  const auto w = static_cast<py::ssize_t>(camera.optics().width);
  const auto h = static_cast<py::ssize_t>(camera.optics().height);
  py::array_t<std::uint8_t> rgba({h, w, static_cast<py::ssize_t>(4)});
  py::array_t<float> depth({h, w});
  std::vector<std::uint32_t> pixels(static_cast<std::size_t>(w * h));
  camera.render(panels.panels, stands, unseen, {eye.at(0), eye.at(1), eye.at(2), eye.at(3)},
                {pack(ground.data()), pack(sky.data())}, pixels.data(), depth.mutable_data());
  std::memcpy(rgba.mutable_data(), pixels.data(), pixels.size() * sizeof(std::uint32_t));
  return py::make_tuple(rgba, depth);
}

}  // namespace

void bindCamera(py::module_& m) {
  py::class_<Panels>(m, "Panels", "Upright walls in the frames of their bodies.")
      .def(py::init(&makePanels), py::arg("walls"), py::arg("colors"), py::arg("prisms"), py::arg("bodies"),
           "From walls (m, 6): x, y of both ends, lowest and highest z [m]; colors (m, 4) of bytes; prisms "
           "(m,):\n"
           "the closed outlines a wall is part of, -1 for none; bodies (m,). Raises "
           "ValueError.")
      .def("__len__", [](const Panels& panels) { return panels.panels.size(); });

  py::class_<Camera>(m, "Camera", "A colour and depth camera that needs no display.")
      .def(py::init(
               [](int width, int height, double fov_h, double fov_v, double near, double far, double tilt) {
                 return Camera({width, height, fov_h, fov_v, near, far, tilt});
               }),
           py::kw_only(), py::arg("width"), py::arg("height"), py::arg("fov_h"), py::arg("fov_v"),
           py::arg("near"), py::arg("far"), py::arg("tilt"))
      .def("render", &render, py::arg("panels"), py::arg("poses"), py::arg("hidden"), py::arg("eye"),
           py::arg("ground"), py::arg("sky"),
           "Colours (h, w, 4) of bytes and depths (h, w) of float32 [m] along the optical axis: -inf too "
           "near, +inf\n"
           "too far. poses (b, 4) of the bodies, hidden (b,), eye (4,): x, y, z [m], heading [rad] in the "
           "map.");
}

}  // namespace kurumaisu
