// SPDX-License-Identifier: BSD-3-Clause
// A scan as the sensor sends it.
#pragma once

#include <cstdint>
#include <vector>

#include "scip/message.h"
#include "scip/request.h"

namespace kurumaisu::scip {

/// One rotation of the mirror.
struct Rotation {
  std::uint32_t clock = 0;       ///< [ms] of the sensor, 24 bits, when the mirror was at step 0
  std::vector<int> distances;    ///< (beams,) [mm]; below 20 a code: there is no distance
  std::vector<int> intensities;  ///< (beams,), or none

  bool operator==(const Rotation& other) const {
    return clock == other.clock && distances == other.distances && intensities == other.intensities;
  }
};

/// The sensor's clock in the four characters of a time stamp; it wraps at 2^24 ms.
std::uint32_t decodeClock(std::string_view characters);

/// Does a reply hold a scan, rather than acknowledge the request?
bool holdsScan(const Message& message);

/// The scan in a reply to a request. Throws BadFrame for another one's, one that is damaged or reports an error.
Rotation decodeScan(const Message& message, const Request& request);

}  // namespace kurumaisu::scip
