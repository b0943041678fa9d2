// SPDX-License-Identifier: BSD-3-Clause
// What can go wrong on demand.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kurumaisu::virtual_urg {

/// `name[@scan][=value]`.
struct Fault {
  std::string name;
  std::optional<int> scan;      ///< of those that the sensor has sent, from 1; none: at each
  std::optional<double> value;  ///< what it means depends on the name
};

/// A fault's text. Throws std::invalid_argument naming what is unknown, missing or too much.
Fault fault(std::string_view text);

/// The name, what may follow it and what it does, line by line.
std::string faultHelp();

/// The faults of one sensor.
class Faults {
 public:
  explicit Faults(std::vector<Fault> faults) : faults_(std::move(faults)) {}

  /// The first of that name, if there is one.
  const Fault* find(std::string_view name) const;

  /// The first of that name that strikes at this scan, if there is one.
  const Fault* find(std::string_view name, int scan) const;

  const std::vector<Fault>& all() const { return faults_; }

 private:
  std::vector<Fault> faults_;
};

}  // namespace kurumaisu::virtual_urg
