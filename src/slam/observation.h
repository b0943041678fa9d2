// SPDX-License-Identifier: BSD-3-Clause
// A scan as MRPT wants it. Internal to src/slam: the only header that shows MRPT's types.
#pragma once

#include <mrpt/obs/CObservation2DRangeScan.h>

#include "slam/scan.h"

namespace kurumaisu {

/// For the likelihood: beams without a return are invalid. MRPT's fans are symmetric, so the asymmetry of
/// ours is put into the yaw of the sensor.
mrpt::obs::CObservation2DRangeScan::Ptr likelihoodObservation(const Scan& scan);

/// For insertion into a grid that takes readings up to free_range [m] as walls: a beam without a return
/// clears the cells up to there.
mrpt::obs::CObservation2DRangeScan::Ptr insertionObservation(const Scan& scan, double free_range);

}  // namespace kurumaisu
