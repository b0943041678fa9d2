// SPDX-License-Identifier: BSD-3-Clause
// The localiser in kurumaisu._slam.
#include "slam/localizer_bindings.h"

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <stdexcept>

#include "slam/localization/localizer.h"

namespace py = pybind11;

namespace kurumaisu {
namespace {

using Triple = std::array<double, 3>;
using Ranges = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Cells = py::array_t<std::int8_t, py::array::c_style>;

Pose2D poseOf(const Triple& values) { return {values[0], values[1], values[2]}; }
Triple tripleOf(const Pose2D& pose) { return {pose.x, pose.y, pose.theta}; }

LocalizerSettings settingsOf(const py::dict& values) {
  const auto names = localizerSettingNames();
  for (const auto& item : values) {
    const auto name = py::cast<std::string>(py::str(item.first));
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      throw std::invalid_argument(name + ": is not a known key");
    }
  }
  return makeLocalizerSettings([&values](const std::string& name) {
    if (!values.contains(name)) throw std::invalid_argument(name + ": is missing");
    return py::cast<double>(values[name.c_str()]);
  });
}

/// laser: of kurumaisu._core, which knows the type; process: sd_v, sd_w, tau, growth.
std::unique_ptr<Localizer> make(const py::dict& settings, const LaserError& laser,
                                const std::array<double, 4>& process, std::uint32_t seed, const Cells& cells,
                                double resolution, const Triple& origin) {
  if (cells.ndim() != 2) throw std::invalid_argument("cells must be two-dimensional");
  const Chair chair{laser, {process[0], process[1], process[2], process[3]}};
  const OccupancyGrid grid{resolution,
                           0,
                           0,
                           static_cast<int>(cells.shape(1)),
                           static_cast<int>(cells.shape(0)),
                           {cells.data(), cells.data() + cells.size()}};
  return std::make_unique<Localizer>(settingsOf(settings), chair, seed, grid, poseOf(origin));
}

py::dict add(Localizer& localizer, double stamp, const Ranges& ranges, const Fan& fan, const Triple& start,
             const Triple& end, const std::optional<Eigen::Matrix3d>& covariance) {
  if (ranges.ndim() != 1) throw std::invalid_argument("ranges must be one-dimensional");
  const Scan scan{stamp, fan, {ranges.data(), ranges.data() + ranges.size()}};
  const auto estimate = localizer.add(scan, {stamp, poseOf(start), covariance}, poseOf(end));
  constexpr std::array<const char*, 3> kNames{"tracking", "ambiguous", "lost"};
  py::dict out;
  out["pose"] = tripleOf(estimate.map_from_base.mean);
  out["covariance"] = estimate.map_from_base.covariance;
  out["knowledge"] = kNames.at(static_cast<std::size_t>(estimate.knowledge));
  out["fit"] = estimate.fit;
  out["fit_usual"] = estimate.fit_usual;
  out["particles"] = estimate.particles;
  out["updated"] = estimate.updated;
  return out;
}

py::array_t<double> particles(const Localizer& localizer) {
  const auto all = localizer.particles();
  py::array_t<double> out({static_cast<py::ssize_t>(all.size()), static_cast<py::ssize_t>(4)});
  auto rows = out.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const auto& [pose, weight] = all[static_cast<std::size_t>(i)];
    rows(i, 0) = pose.x;
    rows(i, 1) = pose.y;
    rows(i, 2) = pose.theta;
    rows(i, 3) = weight;
  }
  return out;
}

}  // namespace

void bindLocalizer(py::module_& m) {
  m.def("localizer_setting_names", &localizerSettingNames, "Names of the localiser's settings.");
  m.def(
      "check_localizer_settings", [](const py::dict& settings) { settingsOf(settings); }, py::arg("settings"),
      "Raise ValueError naming the first key that is missing, unknown or senseless.");
  py::class_<Localizer>(m, "Localizer", "Follows a chair in a known map.")
      .def(py::init(&make), py::kw_only(), py::arg("settings"), py::arg("laser"), py::arg("process"),
           py::arg("seed"), py::arg("cells"), py::arg("resolution"), py::arg("origin"))
      .def(
          "set_pose",
          [](Localizer& localizer, const Triple& pose, const Eigen::Matrix3d& covariance) {
            localizer.setPose({poseOf(pose), covariance});
          },
          py::arg("pose"), py::arg("covariance"))
      .def("forget", &Localizer::forget, "The chair may be anywhere.")
      .def("update_once", &Localizer::updateOnce, "Weigh the next scan though the chair does not move.")
      .def("add", &add, py::arg("stamp"), py::arg("ranges"), py::arg("fan"), py::arg("start"), py::arg("end"),
           py::arg("covariance") = py::none(),
           "Add ranges (beams,) [m], their mean error taken out. Return what is known of the pose.")
      .def("particles", &particles, "Rows of x, y, theta, weight.");
}

}  // namespace kurumaisu
