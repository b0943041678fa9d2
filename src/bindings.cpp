// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core: the code the chair runs, for the simulator and the critic. Vectorised over numpy arrays.
#include "bindings.h"

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <stdexcept>

#include "contact/bindings.h"
#include "kalman/whiten.h"
#include "model/laser_error.h"
#include "model/path.h"
#include "model/voltage_law.h"

namespace py = pybind11;
namespace k = kurumaisu;

namespace {

using k::Array;

void requireSameSize(const Array& a, const Array& b, const char* what) {
  if (a.ndim() != 1 || b.ndim() != 1 || a.size() != b.size()) {
    throw std::invalid_argument(std::string(what) + " must be one-dimensional and of the same length");
  }
}

/// The whole sequence through one AxisInverse; sign: -1, 0, +1, or NaN where the sample does not carry it.
Array ratesAlong(k::AxisInverse& inverse, const Array& volts, const Array& sign) {
  requireSameSize(volts, sign, "volts and sign");
  Array out(volts.size());
  const double* volt = volts.data();
  const double* meant = sign.data();
  double* rate = out.mutable_data();
  bool ambiguous = false;
  for (py::ssize_t i = 0; i < volts.size(); ++i) {
    const auto before = inverse.memory();
    if (i > 0 && volt[i] == volt[i - 1] && meant[i] == meant[i - 1]) {  // held, as most are: so is the answer
      rate[i] = rate[i - 1];
      inverse.recall({before.last_sign, before.ambiguous_samples + (ambiguous ? 1 : 0)});
      continue;
    }
    const double s = meant[i];
    const auto commanded = std::isnan(s) ? std::nullopt : std::optional<int>((s > 0) - (s < 0));
    rate[i] = inverse.rate(volt[i], commanded);
    ambiguous = inverse.ambiguousSamples() != before.ambiguous_samples;
  }
  return out;
}

Array integrate(const Array& v, const Array& w, const Array& dt, const std::array<double, 3>& start) {
  requireSameSize(v, w, "v and w");
  requireSameSize(v, dt, "v and dt");
  Array out({v.size() + 1, static_cast<py::ssize_t>(3)});
  k::integrate({start[0], start[1], start[2]},
               {v.data(), w.data(), dt.data(), static_cast<std::size_t>(v.size())}, out.mutable_data());
  return out;
}

void bindModel(py::module_& m) {
  py::class_<k::Branch>(m, "Branch", "One side of a voltage law: volts = slope * rate + intercept.")
      .def(py::init([](double slope, double intercept) {
             return k::Branch{slope, intercept};
           }),
           py::arg("slope"), py::arg("intercept"))
      .def_readonly("slope", &k::Branch::slope)
      .def_readonly("intercept", &k::Branch::intercept);

  py::class_<k::AxisLaw>(m, "AxisLaw", "Voltage law of one axis, equation (1) or (2).")
      .def(py::init([](k::Branch positive, k::Branch negative) {
             const k::AxisLaw law{positive, negative};
             k::validate(law);
             return law;
           }),
           py::arg("positive"), py::arg("negative"))
      .def_readonly("positive", &k::AxisLaw::positive)
      .def_readonly("negative", &k::AxisLaw::negative)
      .def("volts", py::vectorize([](const k::AxisLaw* law, double rate) { return law->volts(rate); }),
           py::arg("rate"), "Volts that stand for rates [m/s or rad/s], elementwise.")
      .def("gain", py::vectorize([](const k::AxisLaw* law, double rate) { return law->gain(rate); }),
           py::arg("rate"), "Rate per volt on the branch of the rate's sign, elementwise.")
      .def("ambiguous",
           py::vectorize([](const k::AxisLaw* law, double volts) { return law->ambiguous(volts); }),
           py::arg("volts"), "True where two rates answer to the volts, elementwise.");

  py::class_<k::AxisInverse>(m, "AxisInverse", "Single-valued inverse of an AxisLaw along a sequence.")
      .def(py::init<const k::AxisLaw&>(), py::arg("law"))
      .def("rates", &ratesAlong, py::arg("volts"), py::arg("sign"),
           "Rates for volts, shape (n,); sign (n,): -1, 0, +1 as commanded, NaN where unknown. Keeps its "
           "state.")
      .def_property_readonly("ambiguous_samples", &k::AxisInverse::ambiguousSamples)
      .def_property(
          "state",
          [](const k::AxisInverse& self) {
            const k::AxisInverse::Memory memory = self.memory();
            return std::pair(memory.last_sign, memory.ambiguous_samples);
          },
          [](k::AxisInverse& self, const std::pair<int, std::uint64_t>& state) {
            self.recall({state.first, state.second});
          },
          "What the next rates depend on, beside the law: the last sign, and the ambiguous samples so far.");

  m.def("integrate", &integrate, py::arg("v"), py::arg("w"), py::arg("dt"),
        py::arg("start") = std::array<double, 3>{0, 0, 0},
        "Equation (3): poses (n + 1, 3) [m, m, rad] from v [m/s], w [rad/s], dt [s], each (n,).");

  py::class_<k::LaserError>(m, "LaserError", "Equation (4) with quantisation and range gate.")
      .def(py::init([](double scale, double datum_offset, std::array<double, 3> sigma, double resolution,
                       double range_min, double range_max) {
             const k::LaserError error{scale, datum_offset, sigma, resolution, range_min, range_max};
             k::validate(error);
             return error;
           }),
           py::kw_only(), py::arg("scale"), py::arg("datum_offset"), py::arg("sigma"), py::arg("resolution"),
           py::arg("range_min"), py::arg("range_max"))
      .def("mean", py::vectorize([](const k::LaserError* e, double r) { return e->mean(r); }), py::arg("r"),
           "Mean reading [m] at true range r [m], elementwise.")
      .def("range", py::vectorize([](const k::LaserError* e, double reading) { return e->range(reading); }),
           py::arg("reading"), "True range [m] of which a reading [m] is the mean, elementwise.")
      .def("deviation", py::vectorize([](const k::LaserError* e, double r) { return e->deviation(r); }),
           py::arg("r"), "Standard deviation [m] at true range r [m], elementwise.")
      .def("reading",
           py::vectorize([](const k::LaserError* e, double r, double z) { return e->reading(r, z); }),
           py::arg("r"), py::arg("standard_normal"),
           "Reading [m] of true range r [m] for standard normal draws; +inf = no return, NaN = below "
           "range_min.");
}

void bindKalman(py::module_& m) {
  py::class_<k::Whitener>(m, "Whitener",
                          "Whitens residuals of increments between noisy poses by a Kalman filter.")
      .def(py::init([](const Eigen::MatrixXd& poses, const Eigen::VectorXd& times,
                       const Eigen::VectorXd& activity, const Eigen::VectorXd& rolling,
                       const k::Track::Ways& ways, double position_sd, double heading_sd,
                       const Eigen::Matrix<double, 2, 3>& process_sd, const Eigen::Vector2d& process_tau,
                       double lasting, double lasting_tau) {
             const k::Colour fast{process_sd.row(0).transpose(), process_tau[0]};
             const k::Colour slow{process_sd.row(1).transpose(), process_tau[1]};
             return k::Whitener({poses, times, activity, rolling, ways},
                                {position_sd, heading_sd, fast, slow, lasting, lasting_tau});
           }),
           py::arg("poses"), py::arg("times"), py::arg("activity"), py::arg("rolling"), py::arg("ways"),
           py::kw_only(), py::arg("position_sd"), py::arg("heading_sd"), py::arg("process_sd"),
           py::arg("process_tau"), py::arg("lasting"), py::arg("lasting_tau"),
           "For poses (n + 1, 3) at times (n + 1,); activity (n,): factors on the noise of the rates, whose "
           "two colours "
           "are rows of process_sd (2, 3); rolling (n,): on such noise of each increment alone; ways (n, 8): "
           "means of "
           "the heading's cosine and sine and of the way x, y ahead, in the frame of each increment's first "
           "pose, and "
           "by how much each grows from end to end. lasting: share of the variance of the poses' errors that "
           "lasts for lasting_tau [s].")
      .def("whiten", &k::Whitener::whiten, py::arg("columns"),
           "Whitened columns (3 n, m) of increment residuals.")
      .def("gram", &k::Whitener::gram, py::arg("columns"),
           "Products (m, m) of whitened columns with one another.")
      .def_property_readonly("log_determinants", &k::Whitener::logDeterminants,
                             "Log variances (n, 3) that sum to the log determinant of the covariance.");
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.doc() = "Equations (1)-(4) of the paper, ray casting, whitening and the virtual sensor, in C++.";
  bindModel(m);
  bindKalman(m);
  k::bindContact(m);
  k::bindBase(m);
  k::bindFollow(m);
  k::bindPlausible(m);
  k::bindRaycast(m);
  k::bindCamera(m);
  k::bindVirtualUrg(m);
  k::bindWire(m);
}
