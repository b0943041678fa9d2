// SPDX-License-Identifier: BSD-3-Clause
// The other side of the guard's socket, for a control loop.
#pragma once

#include <cstdint>
#include <string>

#include "dac/converter.h"
#include "file_descriptor.h"
#include "guard/protocol.h"

namespace kurumaisu::guard {

struct ClientSettings {
  std::string socket;  ///< the guard's
  double reply_wait;   ///< [s] for an answer at most: the control loop is delayed by it
  double retry_pause;  ///< [s] between attempts to connect
};

/// What is known of the guard.
struct Status {
  bool connected = false;
  State state = State::kIdle;
  Reason reason = Reason::kNone;
  bool has_device = false;        ///< it answers; else what it holds is not known
  dac::Volts volts{};             ///< [V] what the device holds; neutral without a guard
  std::uint32_t trips = 0;        ///< since the guard's start
  std::uint64_t late = 0;         ///< messages not answered in time
  std::uint64_t connections = 0;  ///< since this client's start
  double answered = 0;            ///< when the last answer was made [s, monotonic]
};

/// Sends voltages and tells what was put out. It connects, and connects again, by itself; it never waits longer than
/// reply_wait. Whoever arms must hold neutral first: it is not done here, or a chair might start by itself.
class Client {
 public:
  explicit Client(ClientSettings settings);

  /// Asks for these voltages.
  const Status& put(const dac::Volts& volts) { return exchange(Kind::kPut, volts); }

  /// Asks for neutral at once; it must then be held to arm anew.
  const Status& stop() { return exchange(Kind::kStop, {0, 0, 0}); }

  const Status& status() const { return status_; }

 private:
  const Status& exchange(Kind kind, const dac::Volts& volts);
  bool connect(double now);
  void lose(double now);
  bool hear(double now);
  void note(const Reply& reply);

  ClientSettings settings_;
  Descriptor socket_;
  Status status_;
  std::uint64_t sequence_ = 0;
  std::uint64_t answered_ = 0;  ///< sequence of the last answer
  double retry_at_ = 0;         ///< [s]
};

}  // namespace kurumaisu::guard
