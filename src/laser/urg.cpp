// SPDX-License-Identifier: BSD-3-Clause
#include "laser/urg.h"

#include <cmath>
#include <string_view>
#include <utility>

namespace kurumaisu::laser {
namespace {

constexpr std::size_t kClockWidth = 4;  // characters
constexpr double kMetre = 1000;         // [mm]

}  // namespace

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

std::optional<scip::Rotation> Urg::take() {
  mrpt::obs::CObservation2DRangeScan observation;
  bool taken = false;
  bool error = false;
  doProcessSimple(taken, observation, error);
  if (!taken || error) return std::nullopt;
  scip::Rotation scan;
  scan.clock = scip::decodeClock(std::string_view(m_rcv_data).substr(0, kClockWidth));
  for (std::size_t i = 0; i < observation.getScanSize(); ++i) {
    scan.distances.push_back(static_cast<int>(std::lround(observation.getScanRange(i) * kMetre)));
    if (observation.hasIntensity()) scan.intensities.push_back(observation.getScanIntensity(i));
  }
  return scan;
}

}  // namespace kurumaisu::laser
