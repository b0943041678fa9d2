// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core: the virtual sensor.
#include "bindings.h"

#include <pybind11/stl.h>

#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "virtual_urg/pty.h"
#include "virtual_urg/server.h"
#include "virtual_urg/tcp.h"

namespace kurumaisu {
namespace py = pybind11;
namespace urg = virtual_urg;
namespace {

using Codes = py::array_t<int, py::array::c_style | py::array::forcecast>;

template <class Numbers>
auto listOf(const Numbers& array, const char* name) {
  if (array.ndim() != 1) throw std::invalid_argument(std::string(name) + " must have shape (steps,)");
  return std::vector(array.data(), array.data() + array.size());
}

urg::Measurement measurementOf(double start, const Array& ranges, const std::optional<Array>& intensities,
                               const std::optional<Codes>& codes) {
  urg::Measurement measurement;
  measurement.start = start;
  measurement.ranges = listOf(ranges, "ranges");
  if (intensities) measurement.intensities = listOf(*intensities, "intensities");
  if (codes) measurement.codes = listOf(*codes, "codes");
  return measurement;
}

std::unique_ptr<urg::Server> serverAt(const urg::Model& model, const std::vector<std::string>& faults,
                                      std::unique_ptr<urg::Endpoint> endpoint, const urg::Clock& clock,
                                      const urg::Server::Options& options) {
  std::vector<urg::Fault> parsed;
  parsed.reserve(faults.size());
  for (const std::string& text : faults) parsed.push_back(urg::fault(text));
  return std::make_unique<urg::Server>(model, std::move(parsed), clock, std::move(endpoint), options);
}

std::map<std::string, std::uint64_t> countersOf(const urg::Server& server) {
  const urg::Counters c = server.counters();
  return {{"clients", c.clients},
          {"bytes_in", c.bytes_in},
          {"bytes_out", c.bytes_out},
          {"garbled", c.garbled},
          {"unheard", c.unheard},
          {"dropped", c.dropped},
          {"late", c.late},
          {"commands", c.device.commands},
          {"refused", c.device.refused},
          {"scans", c.device.scans},
          {"lost_input", c.device.lost_input}};
}

void bindModel(py::module_& m) {
  py::class_<urg::Codes>(m, "UrgCodes", "What is sent in place of a distance [mm].")
      .def(py::init<>())
      .def_readwrite("no_return", &urg::Codes::no_return)
      .def_readwrite("error", &urg::Codes::error)
      .def_readwrite("too_near", &urg::Codes::too_near)
      .def_readwrite("outside", &urg::Codes::outside);
  py::class_<urg::Model>(m, "UrgModel", "A kind of sensor; the names are the keys of launch/urg/*.yaml.")
      .def(py::init<>())
      .def_readwrite("name", &urg::Model::name)
      .def_readwrite("version", &urg::Model::version)
      .def_readwrite("version_11", &urg::Model::version_11)
      .def_readwrite("parameters", &urg::Model::parameters)
      .def_readwrite("state", &urg::Model::state)
      .def_readwrite("laser_on", &urg::Model::laser_on)
      .def_readwrite("laser_off", &urg::Model::laser_off)
      .def_readwrite("idle", &urg::Model::idle)
      .def_readwrite("measuring", &urg::Model::measuring)
      .def_readwrite("healthy", &urg::Model::healthy)
      .def_readwrite("ill", &urg::Model::ill)
      .def_readwrite("refused", &urg::Model::refused)
      .def_readwrite("protocol", &urg::Model::protocol)
      .def_readwrite("baud", &urg::Model::baud)
      .def_readwrite("bauds", &urg::Model::bauds)
      .def_readwrite("end_step", &urg::Model::end_step)
      .def_readwrite("codes", &urg::Model::codes)
      .def_readwrite("boot_time", &urg::Model::boot_time)
      .def_readwrite("output_delay", &urg::Model::output_delay)
      .def_readwrite("bad_serial_sum", &urg::Model::bad_serial_sum);
}

}  // namespace

void bindVirtualUrg(py::module_& m) {
  using urg::Server;
  using Release = py::call_guard<py::gil_scoped_release>;
  bindModel(m);
  py::register_local_exception_translator([](std::exception_ptr error) {
    try {
      if (error) std::rethrow_exception(std::move(error));
    } catch (const std::system_error& problem) {
      const py::tuple arguments = py::make_tuple(problem.code().value(), problem.what());
      PyErr_SetObject(PyExc_OSError, arguments.ptr());
    }
  });
  m.def("urg_fault_help", &urg::faultHelp,
        "The faults that a sensor can have: name, what follows it, meaning.");
  py::class_<Server::Options>(m, "UrgOptions", "How a virtual sensor is served.")
      .def(py::init([](bool fed, double patience, bool line_rate) {
             return Server::Options{fed ? urg::Pace::kFed : urg::Pace::kReal, patience, line_rate};
           }),
           py::kw_only(), py::arg("fed"), py::arg("patience"), py::arg("line_rate"));
  py::class_<urg::Clock>(m, "UrgClock", "The sensor's own clock: start [ms], drift [1].")
      .def(py::init([](double start, double drift) {
             return urg::Clock{start, drift};
           }),
           py::kw_only(), py::arg("start"), py::arg("drift"));
  py::class_<Server>(m, "UrgServer", "A virtual sensor that a thread of its own serves.")
      .def_static(
          "at_pty",
          [](const urg::Model& model, const std::vector<std::string>& faults, const urg::Clock& clock,
             const Server::Options& options, std::string link) {
            return serverAt(model, faults, std::make_unique<urg::Pty>(std::move(link)), clock, options);
          },
          py::arg("model"), py::arg("faults"), py::arg("clock"), py::arg("options"), py::arg("link"),
          "At a pseudo terminal to which a link of this name leads. Raises OSError, ValueError.")
      .def_static(
          "at_tcp",
          [](const urg::Model& model, const std::vector<std::string>& faults, const urg::Clock& clock,
             const Server::Options& options, std::string host, std::uint16_t port) {
            return serverAt(model, faults, std::make_unique<urg::Tcp>(std::move(host), port), clock, options);
          },
          py::arg("model"), py::arg("faults"), py::arg("clock"), py::arg("options"), py::arg("host"),
          py::arg("port"), "At a TCP port; 0: any that is free. Raises OSError, ValueError.")
      .def(
          "show",
          [](Server& server, const Array& ranges, const std::optional<Array>& intensities,
             const std::optional<Codes>& codes) {
            urg::Measurement measurement = measurementOf(0, ranges, intensities, codes);
            const py::gil_scoped_release release;
            server.show(std::move(measurement));
          },
          py::arg("ranges"), py::arg("intensities") = py::none(), py::arg("codes") = py::none(),
          "Real time: what turns measure from now on, (steps,) each.")
      .def(
          "measure",
          [](Server& server, double now, double start, const Array& ranges,
             const std::optional<Array>& intensities, const std::optional<Codes>& codes) {
            const urg::Measurement measurement = measurementOf(start, ranges, intensities, codes);
            const py::gil_scoped_release release;
            return server.measure(measurement, now);
          },
          py::arg("now"), py::arg("start"), py::arg("ranges"), py::arg("intensities") = py::none(),
          py::arg("codes") = py::none(), "Fed: a turn that began at `start` is complete. False: dropped.")
      .def("advance", &Server::advance, py::arg("now"), Release(), "Fed: what time it is [s].")
      .def("power_cycle", &Server::powerCycle, Release())
      .def("close", &Server::close, Release(), "End it; a second call does nothing.")
      .def_property_readonly("address", &Server::address)
      .def_property_readonly("connected", &Server::connected)
      .def_property_readonly("baud", &Server::baud)
      .def_property_readonly("counters", &countersOf);
}

}  // namespace kurumaisu
