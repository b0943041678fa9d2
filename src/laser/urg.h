// SPDX-License-Identifier: BSD-3-Clause
// MRPT's driver of URG sensors, over a stream of ours.
#pragma once

#include <mrpt/hwdrivers/CHokuyoURG.h>

#include <memory>
#include <optional>

#include "laser/stream.h"
#include "scip/scan.h"

namespace kurumaisu::laser {

/// One streaming sensor. MRPT 2.5.8 must not own the port: it checks no sum, hangs, spins, and calls itself without end
/// where a port fails.
class Urg : public mrpt::hwdrivers::CHokuyoURG {
 public:
  /// Starts the sensor. Throws what its stream met, Refused where MRPT gave no reason.
  Urg(std::shared_ptr<ScipStream> stream, bool intensity);
  ~Urg() override;

  /// The scan that lies ready in the stream, as MRPT decodes it; none if MRPT does not take it.
  std::optional<scip::Rotation> take();
};

}  // namespace kurumaisu::laser
