// SPDX-License-Identifier: BSD-3-Clause
// Replies, as bytes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "scip/request.h"
#include "scip/sensor.h"
#include "virtual_urg/model.h"

namespace kurumaisu::virtual_urg {

/// A line with its sum.
std::string summed(std::string_view line);

/// The line `KEY:value;` with its sum, which leaves the semicolon out.
std::string keyedLine(std::string_view key, std::string_view value);

/// Echo, status, what follows, and the empty line.
std::string reply(std::string_view echo, std::string_view status, std::string_view body = "");

/// What a PP of these lines says. Throws std::invalid_argument naming the key that is missing or contradicts another.
scip::Parameters parametersOf(const Lines& lines);

/// What the sensor makes of a rotation: one value for each step from 0.
struct Steps {
  std::vector<int> distances;    ///< (end_step + 1,) [mm], or a code
  std::vector<int> intensities;  ///< (end_step + 1,)
};

/// Throws std::invalid_argument where a vector does not run from AMIN to AMAX.
Steps stepsOf(const Measurement& measurement, const Model& model, const scip::Parameters& parameters);

/// A scan's lines: time stamp [ms], then the beams asked for, 64 characters a line.
std::string scanBody(const scip::Request& request, std::uint32_t clock, const Steps& steps, int distance_min);

}  // namespace kurumaisu::virtual_urg
