// SPDX-License-Identifier: BSD-3-Clause
// The virtual sensor: bytes in, bytes out. Time is an argument, there is no I/O.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "virtual_urg/faults.h"
#include "virtual_urg/model.h"

namespace kurumaisu::virtual_urg {

/// What happens to the connection after an output.
enum class Event {
  kNone,
  kClose,   ///< closed in order
  kReset,   ///< torn down: RST
  kHangUp,  ///< the device is pulled out and comes back
};

/// What comes out of the sensor at once.
struct Output {
  std::string bytes;
  double spread = 0;  ///< [s] over which the bytes trickle out; 0: as fast as they can
  Event event = Event::kNone;
  double away = 0;  ///< [s] until it comes back from kHangUp
};

/// The sensor's own clock.
struct Clock {
  double start = 0;  ///< [ms] when it is made; 0 at each power-up after that
  double drift = 0;  ///< [1] it gains: 1.25e-3 is 1.25 ms too much each second
};

struct Counts {
  std::uint64_t commands = 0;  ///< heard
  std::uint64_t refused = 0;   ///< answered by a status other than 00
  std::uint64_t scans = 0;     ///< sent
  std::uint64_t lost_input =
      0;  ///< [bytes] thrown away: lines too long, or heard while it boots or is stalled
};

/// A sensor at one end of a wire. Times are the world's [s] and never go back.
class Device {
 public:
  /// A sensor that has just booted. The fault t0 replaces the clock's start.
  /// Throws std::invalid_argument naming the key of a model that contradicts itself.
  Device(Model model, std::vector<Fault> faults, const Clock& clock, double now);
  ~Device();
  Device(Device&&) noexcept;
  Device& operator=(Device&&) noexcept;

  /// A client opens the connection.
  Output connect(double now);

  /// TCP: the client is gone, and with it what it asked for. A tty's sensor does not notice.
  void disconnect(double now);

  /// Bytes from the client. A new bit rate holds after this output.
  Output receive(std::string_view bytes, double now);

  /// A rotation is complete: the scans that were asked for. Throws std::invalid_argument for vectors of a wrong size.
  Output measure(const Measurement& measurement, double now);

  void powerCycle(double now);

  bool wantsScan() const;                 ///< does anybody wait for a measurement?
  double scanTime() const;                ///< [s] of a turn, as CR has it
  double readyAfter() const;              ///< [s] from step 0 until a scan's first byte goes out
  int baud() const;                       ///< [bit/s] now; 0: it has none
  bool hasStrictBaud() const;             ///< bytes at another rate are garbage
  bool isBlackHole() const;               ///< nothing is ever answered, not even a connection
  std::uint32_t clock(double now) const;  ///< [ms] 24 bits
  const Model& model() const;
  const Counts& counts() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kurumaisu::virtual_urg
