// SPDX-License-Identifier: BSD-3-Clause
// Where a client comes in; one at a time, as on the real sensors.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace kurumaisu::virtual_urg {

/// A pty or a TCP port. Nothing in it waits. Throws std::system_error for what the system refuses at the start.
class Endpoint {
 public:
  Endpoint() = default;
  Endpoint(const Endpoint&) = delete;
  Endpoint& operator=(const Endpoint&) = delete;
  virtual ~Endpoint() = default;

  /// What a client opens: a path, or host:port.
  virtual std::string address() const = 0;

  /// To be polled: the client's if there is one, else what announces one; -1 for neither.
  virtual int descriptor() const = 0;
  virtual bool connected() const = 0;

  /// The descriptor announced something. Is there a client now?
  virtual bool accept() = 0;

  /// Bytes that have come, perhaps none; nothing if the client has gone.
  virtual std::optional<std::string> read() = 0;

  /// How many of the bytes the system took; nothing if the client has gone.
  virtual std::optional<std::size_t> write(std::string_view bytes) = 0;

  /// Does the sensor notice that a client has gone? At a serial port it does not.
  virtual bool tellsLeaving() const = 0;

  /// The rate that the client's side is set to [baud]; 0 where there is no such thing.
  virtual int rate() const { return 0; }

  /// Ends the connection as a program does that closes its end; the next client may come.
  virtual void close() = 0;

  /// Ends it without a farewell, and what is under way is lost.
  virtual void reset() = 0;

  /// Out of the world until plugged in again: nobody finds it.
  virtual void unplug() = 0;
  virtual void plug() = 0;

  /// From now on whoever comes waits in vain.
  virtual void ignore() = 0;
};

}  // namespace kurumaisu::virtual_urg
