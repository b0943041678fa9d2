// SPDX-License-Identifier: BSD-3-Clause
// Commands to a sensor and its replies.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "laser/port.h"
#include "scip/message.h"

namespace kurumaisu::laser {

/// A port on which whole replies come.
class Link {
 public:
  using Now = std::function<double()>;
  using Interrupted = std::function<bool()>;

  /// Stamps replies by now() [s]; gives up all waiting when interrupted() says so, by throwing LinkLost.
  Link(std::unique_ptr<Port> port, Now now, Interrupted interrupted);

  /// Sends a command; its LF is added.
  void send(const std::string& command);

  /// The next whole reply; none if there is none within so long [s].
  std::optional<scip::Message> next(double timeout);

  /// Sends a command and waits for its reply, leaving out all others. None if there is none in so long [s]; while
  /// bytes come, it waits up to `busy` [s].
  std::optional<scip::Message> ask(const std::string& command, double timeout, double busy);

  /// As above. Throws NoAnswer if there is no reply in so long [s].
  scip::Message ask(const std::string& command, double timeout);

  /// Changes the rate [baud] and forgets what came at the other.
  void setBaud(int baud);
  bool hasBaud() const { return port_->hasBaud(); }

  /// Time of the last byte, of no one's clock: steadyTime() [s].
  double lastByte() const { return last_byte_; }

  /// The same in the host's time [s].
  double lastArrival() const { return last_arrival_; }

  const scip::Assembler::Counts& counts() const { return assembler_.counts(); }

 private:
  void receive(double timeout);

  std::unique_ptr<Port> port_;
  Now now_;
  Interrupted interrupted_;
  scip::Assembler assembler_;
  double last_byte_;
  double last_arrival_;
};

}  // namespace kurumaisu::laser
