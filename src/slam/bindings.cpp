// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._slam: mapping for Python. A module of its own, beside _core, because loading MRPT takes a third
// of a second, which the simulator and the critic need not pay.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <stdexcept>

#include "slam/basics/pose.h"
#include "slam/localizer_bindings.h"
#include "slam/mapping/mapper.h"
#include "slam/mapping/rawlog.h"

namespace py = pybind11;
namespace k = kurumaisu;

namespace {

using Triple = std::array<double, 3>;
using Ranges = py::array_t<float, py::array::c_style | py::array::forcecast>;

k::Pose2D poseOf(const Triple& values) { return {values[0], values[1], values[2]}; }
Triple tripleOf(const k::Pose2D& pose) { return {pose.x, pose.y, pose.theta}; }

k::MapperSettings settingsOf(const py::dict& values) {
  for (const auto& item : values) {
    const auto names = k::settingNames();
    const auto name = py::cast<std::string>(py::str(item.first));
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      throw std::invalid_argument(name + ": is not a known key");
    }
  }
  return k::makeSettings([&values](const std::string& name) {
    if (!values.contains(name)) throw std::invalid_argument(name + ": is missing");
    return py::cast<double>(values[name.c_str()]);
  });
}

py::tuple add(k::Mapper& mapper, double stamp, const Ranges& ranges, const k::Fan& fan, const Triple& start,
              const Triple& end) {
  if (ranges.ndim() != 1) throw std::invalid_argument("ranges must be one-dimensional");
  const k::Scan scan{stamp, fan, {ranges.data(), ranges.data() + ranges.size()}};
  k::Mapper::Estimate estimate{};
  {
    const py::gil_scoped_release release;
    estimate = mapper.add(scan, poseOf(start), poseOf(end));
  }
  const py::array_t<double> covariance({3, 3}, estimate.covariance.data());
  return py::make_tuple(tripleOf(estimate.map_from_base), covariance, estimate.map_updated);
}

py::array_t<double> trajectory(const k::Mapper& mapper) {
  const auto path = mapper.trajectory();
  py::array_t<double> out({static_cast<py::ssize_t>(path.size()), static_cast<py::ssize_t>(4)});
  auto rows = out.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    rows(i, 0) = path[i].stamp;
    rows(i, 1) = path[i].pose.x;
    rows(i, 2) = path[i].pose.y;
    rows(i, 3) = path[i].pose.theta;
  }
  return out;
}

py::tuple grid(const k::Mapper& mapper) {
  const auto grid = mapper.grid();
  const py::array_t<std::int8_t> cells({grid.height, grid.width}, grid.cells.data());
  return py::make_tuple(cells, grid.resolution, std::array<double, 2>{grid.x, grid.y});
}

/// Rows of t, x, y, theta, and the covariance's xx, xy, yy, xt, yt, tt.
py::array_t<double> nodes(const k::Mapper& mapper) {
  const auto path = mapper.nodes();
  py::array_t<double> out({static_cast<py::ssize_t>(path.size()), static_cast<py::ssize_t>(10)});
  for (std::size_t i = 0; i < path.size(); ++i) {
    const auto& [stamp, pose, c] = path[i];
    const std::array<double, 10> row{stamp, pose.x, pose.y, pose.theta, c[0], c[1], c[4], c[2], c[5], c[8]};
    std::copy(row.begin(), row.end(), out.mutable_data(static_cast<py::ssize_t>(i), 0));
  }
  return out;
}

void resume(k::Mapper& mapper, const std::string& path, const py::dict& settings, const Triple& pose,
            const Triple& deviations) {
  k::Gaussian start{poseOf(pose), Eigen::Matrix3d::Zero()};
  for (int i = 0; i < 3; ++i) start.covariance(i, i) = deviations[i] * deviations[i];
  mapper.resume(k::savedMapOf(k::readSimplemap(path), settingsOf(settings)), start);
}

py::tuple readRawlog(const std::string& path) {
  k::LaserLog log{};
  {
    const py::gil_scoped_release release;
    log = k::readRawlog(path);
  }
  const auto n = static_cast<py::ssize_t>(log.times.size());
  py::array_t<double> odom({n, static_cast<py::ssize_t>(3)});
  py::array_t<float> ranges({n, static_cast<py::ssize_t>(log.beams)});
  for (py::ssize_t i = 0; i < n; ++i) {
    const Triple pose = tripleOf(log.odom[i]);
    std::copy(pose.begin(), pose.end(), odom.mutable_data(i, 0));
    std::copy(log.ranges[i].begin(), log.ranges[i].end(), ranges.mutable_data(i, 0));
  }
  return py::make_tuple(py::array_t<double>(n, log.times.data()), odom, ranges, log.fan);
}

void writeRawlog(const std::string& path, const std::vector<double>& times, const py::array_t<double>& odom,
                 const py::array_t<double>& ends, const py::array_t<float, py::array::c_style>& ranges,
                 const k::Fan& fan) {
  k::LaserLog log{fan, static_cast<std::size_t>(ranges.shape(1)), times, {}, {}};
  log.fan.time_increment = 0;
  const auto at = odom.unchecked<2>();
  const auto end = ends.unchecked<2>();
  for (py::ssize_t i = 0; i < at.shape(0); ++i) {
    const k::Pose2D start{at(i, 0), at(i, 1), at(i, 2)};
    const k::Scan scan{
        times[static_cast<std::size_t>(i)], fan, {ranges.data(i, 0), ranges.data(i, 0) + log.beams}};
    log.odom.push_back(start);
    log.ranges.push_back(k::deskew(scan, k::between(start, {end(i, 0), end(i, 1), end(i, 2)})).ranges);
  }
  k::writeRawlog(path, log);
}

}  // namespace

PYBIND11_MODULE(_slam, m) {
  m.doc() = "Mapping with MRPT's Rao-Blackwellised particle filter, and its recordings.";

  py::class_<k::Fan>(m, "Fan", "Where a laser's beams point and when: radians, seconds, metres.")
      .def(py::init([](double angle_min, double angle_increment, double time_increment, double range_max,
                       const Triple& base_from_laser) {
             return k::Fan{angle_min, angle_increment, time_increment, range_max, poseOf(base_from_laser)};
           }),
           py::kw_only(), py::arg("angle_min"), py::arg("angle_increment"), py::arg("time_increment"),
           py::arg("range_max"), py::arg("base_from_laser"))
      .def_readonly("angle_min", &k::Fan::angle_min)
      .def_readonly("angle_increment", &k::Fan::angle_increment)
      .def_readonly("time_increment", &k::Fan::time_increment)
      .def_readonly("range_max", &k::Fan::range_max)
      .def_property_readonly("base_from_laser",
                             [](const k::Fan& fan) { return tripleOf(fan.base_from_laser); });

  m.def("setting_names", &k::settingNames, "Names of the mapper's settings.");

  m.def(
      "check_settings", [](const py::dict& settings) { settingsOf(settings); }, py::arg("settings"),
      "Raise ValueError naming the first key that is missing, unknown or senseless.");

  py::class_<k::Mapper>(m, "Mapper", "Builds a map from scans and odometry.")
      .def(py::init([](const py::dict& settings, std::uint32_t seed) {
             return std::make_unique<k::Mapper>(settingsOf(settings), seed);
           }),
           py::arg("settings"), py::arg("seed"),
           "All of setting_names() and no other key. Raise ValueError naming a key that is wrong.")
      .def("add", &add, py::arg("stamp"), py::arg("ranges"), py::arg("fan"), py::arg("start"), py::arg("end"),
           "Add ranges (beams,) [m] taken at stamp [s]; start, end: odom_from_base [m, m, rad] at the first "
           "and at "
           "the last beam. Return map_from_base at the stamp, its covariance (3, 3), whether the map was "
           "updated.")
      .def("trajectory", &trajectory,
           "map_from_base at every scan, (n, 4) of t, x, y, theta, as the likeliest particle now sees its "
           "past.")
      .def("grid", &grid,
           "Cells (height, width) from the lower left corner: 0 free to 100 occupied, -1 never seen; "
           "resolution "
           "[m]; the corner's x, y [m].")
      .def("nodes", &nodes,
           "The likeliest particle's path where the filter ran, (n, 10) of t, x, y, theta, and the "
           "covariance of the "
           "particles around it: xx, xy, yy, xt, yt, tt.")
      .def(
          "write_simplemap",
          [](const k::Mapper& mapper, const std::string& path) { k::writeSimplemap(path, mapper.keys()); },
          py::arg("path"), "Write MRPT's simplemap. Raise RuntimeError naming the file.")
      .def("resume", &resume, py::arg("path"), py::arg("settings"), py::arg("pose"), py::arg("deviations"),
           "Go on from a simplemap; the chair is about at map_from_base [m, m, rad], with those deviations. "
           "Before any "
           "scan. Raise RuntimeError naming the file, or ValueError for what makes no sense.");

  m.def("read_rawlog", &readRawlog, py::arg("path"),
        "Times (n,) [s], odom_from_base (n, 3) at the scans, ranges (n, beams) [m], the fan. Raise "
        "RuntimeError "
        "naming the file and what is wrong.");

  m.def("write_rawlog", &writeRawlog, py::arg("path"), py::arg("times"), py::arg("odom"), py::arg("odom_end"),
        py::arg("ranges"), py::arg("fan"),
        "Write what read_rawlog() reads, each scan as if taken at its first beam. odom, odom_end: "
        "odom_from_base (n, 3) "
        "at the first and at the last beam. Raise RuntimeError naming the file.");

  k::bindLocalizer(m);
}
