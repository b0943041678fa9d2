// SPDX-License-Identifier: BSD-3-Clause
// A line to a device, whatever it is made of.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>

#include "steady.h"

namespace kurumaisu::serial {

/// The device cannot be reached, or no longer.
struct LinkLost : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// It is there, but does not answer.
struct NoAnswer : LinkLost {
  using LinkLost::LinkLost;
};

/// Another program holds the port.
struct PortInUse : LinkLost {
  using LinkLost::LinkLost;
};

/// Bytes to and from a device. Every call returns in a bounded time.
class Port {
 public:
  Port() = default;
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;
  virtual ~Port() = default;

  /// Waits for bytes at most so long [s] and puts them into the buffer; 0 if none came. Throws LinkLost.
  virtual std::size_t read(char* buffer, std::size_t size, double timeout) = 0;

  /// Sends all of it. Throws LinkLost, also if that takes longer than so long [s].
  virtual void write(std::string_view bytes, double timeout) = 0;

  /// Has it a rate that both ends must agree on?
  virtual bool hasBaud() const = 0;

  /// Changes the rate [baud]; what was under way is lost.
  virtual void setBaud(int baud) = 0;
};

}  // namespace kurumaisu::serial
