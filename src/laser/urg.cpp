// SPDX-License-Identifier: BSD-3-Clause
#include "laser/urg.h"

#include <utility>

namespace kurumaisu::laser {

Urg::Urg(std::shared_ptr<ScipStream> stream, bool intensity) {
  logging_enable_console_output = false;  // what it would say, our own link has said
  m_disable_firmware_timestamp = true;    // it takes a wrap of the clock for 49 days
  setIntensityMode(intensity);
  const ScipStream& ours = *stream;
  bindIO(std::move(stream));
  const bool started = turnOn();
  ours.rethrow();
  if (!started) throw Refused("LASER_REFUSED: MRPT could not start the sensor");
}

// Or the base would switch the laser off, over a link that may be lost; the driver does that where it can.
Urg::~Urg() { m_stream.reset(); }

bool Urg::take(mrpt::obs::CObservation2DRangeScan& observation) {
  bool taken = false;
  bool error = false;
  doProcessSimple(taken, observation, error);
  return taken && !error;
}

}  // namespace kurumaisu::laser
