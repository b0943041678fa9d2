// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core: what makes sense of what comes from outside.
#include "bindings.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "plausible/covariance.h"
#include "plausible/quantity.h"
#include "plausible/rotation.h"

namespace kurumaisu {
namespace py = pybind11;

void bindPlausible(py::module_& m) {
  m.def(
      "require",
      [](const std::string& quantity, const std::string& what, double value) {
        require(quantityOf(quantity), what, value);
      },
      py::arg("quantity"), py::arg("what"), py::arg("value"),
      "Raise ValueError with what is expected and what came unless a number is in its quantity's plausible "
      "range.");
  m.def(
      "yaw_of",
      [](double x, double y, double z, double w) {
        return yawOf({x, y, z, w});
      },
      py::arg("x"), py::arg("y"), py::arg("z"), py::arg("w"),
      "The yaw [rad] of a quaternion of any length. Raise ValueError for one that has none.");
  m.def("require_covariance", &requireCovariance, py::arg("covariance"),
        "Raise ValueError unless this (3, 3) can be the covariance of x, y [m], heading [rad].");
  m.def("frame_of", &frameOf, py::arg("name"), "The name of a frame without a slash in front of it.");
}

}  // namespace kurumaisu
