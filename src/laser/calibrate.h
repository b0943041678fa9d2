// SPDX-License-Identifier: BSD-3-Clause
// The sensor's clock, asked for.
#pragma once

#include <functional>

#include "laser/clock.h"
#include "laser/handshake.h"
#include "laser/link.h"

namespace kurumaisu::laser {

/// Asks an idle sensor for its time, again and again, by the adjust mode (TM); its laser is off meanwhile. The clock
/// begins afresh. now() is the host's time [s]. Throws LinkLost.
void calibrate(Link& link, DeviceClock& clock, const std::function<double()>& now, double answer_timeout,
               const Tell& tell);

}  // namespace kurumaisu::laser
