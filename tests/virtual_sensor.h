// SPDX-License-Identifier: BSD-3-Clause
// A shipped sensor with faults, at a time of its own.
#pragma once

#include <string>
#include <vector>

#include "sensor_file.h"
#include "virtual_urg/device.h"

namespace kurumaisu::virtual_urg {

inline std::vector<Fault> faultsOf(const std::vector<std::string>& texts) {
  std::vector<Fault> faults;
  for (const std::string& text : texts) faults.push_back(fault(text));
  return faults;
}

inline Model shipped(const std::string& name) { return modelOf(SOURCE_DIR "/launch/urg/" + name + ".yaml"); }

struct Sensor {
  explicit Sensor(const std::string& name, const std::vector<std::string>& faults = {},
                  const Clock& clock = {})
      : device(shipped(name), faultsOf(faults), clock, 0) {}

  std::string ask(const std::string& line) { return device.receive(line + "\n", now).bytes; }

  /// Status of a reply, without its sum.
  std::string status(const std::string& line) { return ask(line).substr(line.size() + 1, 2); }

  int first() const { return number("AMIN"); }
  int steps() const { return number("AMAX") - first() + 1; }

  /// The next turn of the mirror sees all at one range [m].
  Output turn(double range = 1) {
    return turn(std::vector<double>(static_cast<std::size_t>(steps()), range));
  }

  Output turn(const std::vector<double>& ranges) {
    Measurement measurement;
    measurement.start = now;
    measurement.ranges = ranges;
    now += device.scanTime();
    return device.measure(measurement, measurement.start + device.readyAfter());
  }

  int number(const std::string& key) const {
    for (const auto& [name, value] : device.model().parameters) {
      if (name == key) return std::stoi(value);
    }
    throw std::out_of_range(key);
  }

  Device device;
  double now = 0;  // [s]
};

}  // namespace kurumaisu::virtual_urg
