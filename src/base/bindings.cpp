// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core: the chair's own odometry, along a drive.
#include "bindings.h"

#include <pybind11/stl.h>

#include <array>
#include <stdexcept>

#include "base/odometry/odometry.h"

namespace kurumaisu {
namespace py = pybind11;
namespace {

py::tuple deadReckoning(const Array& v, const Array& w, double dt, const std::array<double, 5>& growth,
                        const std::array<double, 4>& rates) {
  if (v.ndim() != 1 || w.ndim() != 1 || v.size() != w.size()) {
    throw std::invalid_argument("v and w must be one-dimensional and of the same length");
  }
  Odometry odometry(
      {growth[0], growth[1], growth[2], growth[3], growth[4], {rates[0], rates[1], rates[2], rates[3]}});
  Array poses({v.size() + 1, py::ssize_t{3}});
  Array covariances({v.size() + 1, py::ssize_t{3}, py::ssize_t{3}});
  auto pose = poses.mutable_unchecked<2>();
  auto covariance = covariances.mutable_unchecked<3>();
  for (py::ssize_t i = 0;; ++i) {
    pose(i, 0) = odometry.pose().x;
    pose(i, 1) = odometry.pose().y;
    pose(i, 2) = odometry.pose().theta;
    const Eigen::Matrix3d now = odometry.covariance();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) covariance(i, row, column) = now(row, column);
    }
    if (i == v.size()) return py::make_tuple(poses, covariances);
    odometry.advance(v.at(i), w.at(i), dt);
  }
}

}  // namespace

void bindBase(py::module_& m) {
  m.def(
      "dead_reckoning", &deadReckoning, py::arg("v"), py::arg("w"), py::arg("dt"), py::arg("growth"),
      py::arg("rates"),
      "Poses (n + 1, 3) of base_node's odometry over steps of dt [s] at v, w (n,), and their covariances\n"
      "(n + 1, 3, 3). growth: variances forward per metre and radian, lateral per metre, heading per metre\n"
      "and radian; rates: sd_v, sd_w, tau, growth of base.process_noise.");
}

}  // namespace kurumaisu
