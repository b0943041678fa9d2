// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core: following. Vectorised over numpy arrays.
#include "bindings.h"

#include <algorithm>
#include <stdexcept>

#include "follow/follow.h"

namespace kurumaisu {
namespace py = pybind11;
namespace {

/// Each input through one step of a follower: outputs (n,) and the level reached.
template <typename Step>
Array along(const Array& inputs, Step step) {
  if (inputs.ndim() != 1) throw std::invalid_argument("inputs must have shape (n,)");
  Array out(inputs.size());
  std::transform(inputs.data(), inputs.data() + inputs.size(), out.mutable_data(), step);
  return out;
}

py::tuple ramp(const Array& targets, double slowness, double dt, double level) {
  if (!(slowness >= 0) || !(dt > 0)) {
    throw std::invalid_argument("slowness must not be negative and dt must be positive");
  }
  RateLimiter it(slowness, level);
  const Array means = along(targets, [&](double target) { return it.step(target, dt); });
  return py::make_tuple(means, it.level());
}

py::tuple lag(const Array& targets, double tau, double dt, double level) {
  if (!(tau > 0) || !(dt > 0)) throw std::invalid_argument("tau and dt must be positive");
  Lag it(tau, dt, level);
  const Array means = along(targets, [&](double target) { return it.step(target); });
  return py::make_tuple(means, it.level());
}

py::tuple play(const Array& inputs, double half, double level) {
  if (!(half >= 0)) throw std::invalid_argument("half must not be negative");
  Play it(half, level);
  const Array outputs = along(inputs, [&](double input) { return it.step(input); });
  return py::make_tuple(outputs, it.level());
}

}  // namespace

void bindFollow(py::module_& m) {
  m.def("ramp", &ramp, py::arg("targets"), py::arg("slowness"), py::arg("dt"), py::arg("level"),
        "Means (n,) over steps of dt [s] of an output that runs after targets (n,), at most 1 / slowness per "
        "second,\n"
        "from a level on; and the level reached.");
  m.def("lag", &lag, py::arg("targets"), py::arg("tau"), py::arg("dt"), py::arg("level"),
        "Means (n,) over steps of dt [s] of a first-order lag of tau [s] behind targets (n,), from a level "
        "on; and\n"
        "the level reached.");
  m.def(
      "play", &play, py::arg("inputs"), py::arg("half"), py::arg("level"),
      "Outputs (n,) that inputs (n,) drag along, each never more than half from its input, from a level on; "
      "and the\n"
      "level reached.");
}

}  // namespace kurumaisu
