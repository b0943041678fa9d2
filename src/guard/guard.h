// SPDX-License-Identifier: BSD-3-Clause
// Decides what the D/A converter may put out. Pure: no clock, no socket, no device; time is an argument.
#pragma once

#include <cstdint>
#include <optional>

#include "dac/converter.h"
#include "guard/protocol.h"

namespace kurumaisu::guard {

/// Voltages that a client may ask for; 0 is among them.
struct Band {
  double low;   ///< [V]
  double high;  ///< [V]
  double step;  ///< [V] away from neutral at once; towards neutral is free
  double rate;  ///< [V/s] at which, after a step, one more becomes possible
};

struct Limits {
  Band translation;
  Band steering;
  double reference;            ///< [V] put out always
  double reference_tolerance;  ///< [V] by which a client's may differ
  double neutral;              ///< [V] to either side: counts as neutral where neutral is asked for
  double arming;               ///< [s] of neutral before motion
  double silence;              ///< [s] after the last valid message was made: neutral
  double age;                  ///< [s] of a message at most
};

/// Throws std::invalid_argument naming the limit that makes no sense.
void validate(const Limits& limits);

/// From a client's messages to three voltages.
///
/// Neutral, unless the client has held neutral for `arming` and every message since was valid, in time, and a small
/// step from the one before, however fast they come. Whatever else happens trips: neutral at once, until neutral has
/// been held again.
class Guard {
 public:
  explicit Guard(const Limits& limits);

  /// A client came; its messages count from one that may have any number.
  void connect();
  void disconnect();

  /// A message at time now [s, monotonic].
  void receive(const Request& request, double now);

  /// Something came that is no message.
  void receiveGarbage() { trip(Reason::kGarbage); }

  /// The device failed, or is not there yet: neutral, and no arming until it is.
  void loseDevice();
  void findDevice() { has_device_ = true; }

  /// Whether somebody would notice the death of this process: neutral, and no arming, while nobody does.
  void watch(bool is_watched);

  /// This computer slept: nothing that was asked for before counts.
  void wake() { trip(Reason::kSlept); }

  /// Notices silence. To be called before output(), and at deadline() at the latest.
  void advance(double now);

  /// When silence will trip [s]; none while nothing can.
  std::optional<double> deadline() const;

  dac::Volts output() const;
  State state() const { return state_; }
  Reason reason() const { return reason_; }
  std::uint32_t trips() const { return trips_; }

 private:
  Reason judge(const Request& request, double now) const;
  Reason judgeTime(const Request& request, double now) const;
  Reason judgeVolts(const Request& request, double now) const;
  void accept(const Request& request, double now);
  void trip(Reason reason);
  bool isNeutral(const Request& request) const;

  /// One voltage, and how far it may go at once: a bucket of `step` that fills with `rate`.
  struct Axis {
    Band band;
    double volts = 0;  ///< [V] of the last valid message
    double spent = 0;  ///< [V] of the step, at the time `at`
    double at = 0;     ///< [s]

    double spentAt(double now) const;
    bool allows(double to, double now) const;
    void go(double to, double now);
  };

  Limits limits_;
  State state_ = State::kIdle;
  Reason reason_ = Reason::kNone;
  std::uint32_t trips_ = 0;
  bool has_device_ = true;
  bool is_watched_ = true;
  std::optional<std::uint64_t> sequence_;  ///< of the last valid message of this client
  double last_made_ = 0;                   ///< its stamp [s]
  double hold_since_ = 0;                  ///< when holding began [s]
  Axis translation_;
  Axis steering_;
};

}  // namespace kurumaisu::guard
