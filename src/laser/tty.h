// SPDX-License-Identifier: BSD-3-Clause
// A sensor on USB or RS-232.
#pragma once

#include <string>

#include "laser/port.h"
#include "serial/tty.h"

namespace kurumaisu::laser {

class Tty : public serial::Tty {
 public:
  Tty(const std::string& path, int baud) : serial::Tty(path, baud, kWho) {}
};

}  // namespace kurumaisu::laser
