// SPDX-License-Identifier: BSD-3-Clause
// Parts of a model file that several nodes read.
#pragma once

#include <stdexcept>
#include <vector>

#include "model/laser_error.h"
#include "model/rate_noise.h"
#include "params.h"

namespace kurumaisu {

/// Reads laser.error; the rest of the file has other readers.
inline LaserError readLaserError(Section model) {
  Section laser = model.section("laser");
  Section section = laser.section("error");
  const std::vector<double> sigma = section.numbers("sigma", 3);
  const LaserError error{section.number("scale"),        section.number("datum_offset"),
                         {sigma[0], sigma[1], sigma[2]}, section.number("resolution"),
                         section.number("range_min"),    section.number("range_max")};
  section.end();
  try {
    validate(error);
  } catch (const std::invalid_argument& problem) {
    throw section.error("", problem.what());
  }
  return error;
}

/// Reads the parameters of the effect base.process_noise.
inline RateNoise readRateNoise(Section parameters) {
  const RateNoise noise{parameters.atLeast("sd_v", 0), parameters.atLeast("sd_w", 0),
                        parameters.above("tau", 0), parameters.atLeast("growth", 0)};
  parameters.end();
  return noise;
}

}  // namespace kurumaisu
