// SPDX-License-Identifier: BSD-3-Clause
// A line to a sensor, whatever it is made of.
#pragma once

#include "serial/port.h"

namespace kurumaisu::laser {

using kurumaisu::steadyTime;
using serial::LinkLost;
using serial::NoAnswer;
using serial::Port;
using serial::PortInUse;

constexpr const char* kWho = "LASER";  // the codes of errors begin so: LASER_NO_PORT

}  // namespace kurumaisu::laser
