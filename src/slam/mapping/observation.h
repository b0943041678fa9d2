// SPDX-License-Identifier: BSD-3-Clause
// A scan as MRPT wants it. Internal to src/slam: the only header that shows MRPT's types.
#pragma once

#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>

#include <vector>

#include "slam/basics/scan.h"
#include "slam/mapping/settings.h"

namespace kurumaisu {

/// For the likelihood: beams without a return are invalid. MRPT's fans are symmetric, so the asymmetry of
/// ours is put into the yaw of the sensor.
mrpt::obs::CObservation2DRangeScan::Ptr likelihoodObservation(const Scan& scan);

/// For insertion into a grid that takes readings up to free_range [m] as walls: a beam without a return
/// clears the cells up to there.
mrpt::obs::CObservation2DRangeScan::Ptr insertionObservation(const Scan& scan, double free_range);

/// For a file: a beam without a return is invalid at the laser's range, one of which nothing is known at 0.
mrpt::obs::CObservation2DRangeScan::Ptr keptObservation(const Scan& scan);

/// Where the beams of MRPT's scan point. Throws std::runtime_error for a laser that is tilted, or has fewer than 2 beams.
Fan fanOf(const mrpt::obs::CObservation2DRangeScan& observation);

/// Readings as in Scan: those at the laser's range or beyond have met nothing, others that are invalid say nothing.
std::vector<float> rangesOf(const mrpt::obs::CObservation2DRangeScan& observation);

/// How readings go into a grid.
void setInsertion(mrpt::maps::COccupancyGridMap2D::TInsertionOptions& options,
                  const MapperSettings& settings);

}  // namespace kurumaisu
