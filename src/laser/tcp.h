// SPDX-License-Identifier: BSD-3-Clause
// A sensor on Ethernet.
#pragma once

#include <functional>
#include <string>

#include "laser/port.h"
#include "serial/descriptor.h"

namespace kurumaisu::laser {

class Tcp : public Port {
 public:
  /// Connects to an address in numbers. Throws LinkLost, also after so long [s] or as soon as it is interrupted.
  Tcp(const std::string& address, int port, double timeout, const std::function<bool()>& interrupted);

  std::size_t read(char* buffer, std::size_t size, double timeout) override;
  void write(std::string_view bytes, double timeout) override;
  bool hasBaud() const override { return false; }
  void setBaud(int /*baud*/) override {}

 private:
  serial::Descriptor socket_;
};

}  // namespace kurumaisu::laser
