// SPDX-License-Identifier: BSD-3-Clause
// A device on USB or RS-232.
#pragma once

#include <string>

#include "serial/descriptor.h"
#include "serial/port.h"

namespace kurumaisu::serial {

class Tty : public Port {
 public:
  /// Opens a tty for this program alone: raw, 8N1, without flow control. Throws PortInUse, LinkLost,
  /// whose messages begin with a code, which begins with who: DAC_NO_PORT.
  Tty(const std::string& path, int baud, const std::string& who);
  ~Tty() override;

  std::size_t read(char* buffer, std::size_t size, double timeout) override;
  void write(std::string_view bytes, double timeout) override;
  bool hasBaud() const override { return true; }
  void setBaud(int baud) override;

 private:
  std::string path_;
  std::string who_;
  Descriptor tty_;
};

}  // namespace kurumaisu::serial
