// SPDX-License-Identifier: BSD-3-Clause
// A sensor on USB or RS-232.
#pragma once

#include <string>

#include "laser/descriptor.h"
#include "laser/port.h"

namespace kurumaisu::laser {

class Tty : public Port {
 public:
  /// Opens a tty for this program alone: raw, 8N1, without flow control. Throws PortInUse, LinkLost.
  Tty(const std::string& path, int baud);
  ~Tty() override;

  std::size_t read(char* buffer, std::size_t size, double timeout) override;
  void write(std::string_view bytes, double timeout) override;
  bool hasBaud() const override { return true; }
  void setBaud(int baud) override;

 private:
  std::string path_;
  Descriptor tty_;
};

}  // namespace kurumaisu::laser
