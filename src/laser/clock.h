// SPDX-License-Identifier: BSD-3-Clause
// The host's time of what a sensor measured, from the sensor's own clock.
#pragma once

#include <cstdint>
#include <optional>

#include "laser/envelope.h"

namespace kurumaisu::laser {

/// What the sensor's clock counts.
enum class TimeMode {
  kEnvelope,  ///< time since it was switched on, at a rate of its own
  kDevice,    ///< the host's time modulo 2^24 ms: a virtual sensor under simulated time
  kHost,      ///< nothing that is asked for: a scan is as old as the least delay when it comes
};

/// Turns a sensor's clock (24 bits, 1 ms, up to 0.5 % too fast or slow) into the host's time.
///
/// A scan's bytes can only come later than they were sent. So of all lines that lie below the points (sensor's time,
/// arrival), the highest tells host's time from sensor's; its slope is the drift. The first stamps are as late as the
/// first scans, and until the drift has been seen for 2 to 5 s it is taken to be what it was, at first 0: then a stamp is
/// off by up to 2 ms for each 0.1 % of drift. docs/laser_node.md has figures.
class DeviceClock {
 public:
  struct State {
    double offset = 0;        ///< [s] host's time less the sensor's, which counts on where it wraps
    double drift = 0;         ///< [s/s] by which the sensor's clock runs fast; found after a few seconds
    double latency = 0;       ///< [s] of the newest scan, from its last step to its first byte
    double send_delay = 0;    ///< [s] the shortest latency, if calibrated; else unknown and taken as 0
    double span = 0;          ///< [s] that the line rests on
    bool calibrated = false;  ///< by calibrate()
    bool fallback = false;    ///< TimeMode::kDevice is asked for, but the clock is not the host's
    bool stands = false;  ///< the sensor's clock has not moved since the scan before: a stamp is the host's
    std::uint64_t resets = 0;  ///< reboots of the sensor, steps of either clock
  };

  explicit DeviceClock(TimeMode mode) : mode_(mode) {}

  /// The host's time [s] at which the sensor read its clock [ms] for a scan.
  ///
  /// first_byte: [s] when the scan began to come; least_delay: [s] before which it cannot have been sent (Fan).
  /// In envelope mode the result is never after first_byte - least_delay, and never before the one of the scan
  /// before unless the host's time went back. In device mode it is the sensor's own, which leads a host's clock that
  /// lags, also where both were held up and are far apart for a while. Each scan must come once.
  double stamp(std::uint32_t clock, double first_byte, double least_delay);

  /// Takes the sensor's clock [ms], asked for at one time [s] and answered at another: by TM1 in between, by II as its
  /// answer begins to come, so that both are that.
  ///
  /// Of several, that with the shortest way counts. To be given before the first scan.
  void calibrate(std::uint32_t clock, double sent, double received);

  /// Forgets all but the drift, what a scan takes to be sent, and the last stamp: the sensor may have been off.
  ///
  /// Is done unasked where its clock or the host's shows that it was set.
  void restart();

  /// Forgets everything: another sensor, or another link to it.
  void reset();

  const State& state() const { return state_; }

 private:
  struct Reading {
    std::uint32_t clock = 0;
    std::int64_t device = 0;  // [ms] clock, counted on where it wraps
    double host = 0;          // [s]
    bool told = false;        // by calibrate(): a scan under way began before
  };
  struct Stamped {
    double host = 0;  // [s] first byte
    double stamp = 0;
  };
  struct Own {
    double newest = 0;            // [s] by the sensor's clock, which is the host's
    std::optional<double> apart;  // [s] by it, since when the host's says otherwise
  };
  struct Late {
    double since = 0;  // [s] host's time
    Point lowest;
  };
  struct Calibration {
    Point point;       // y as a scan sent and received at once would have it
    double doubt = 0;  // [s] how long the way there and back took
  };

  double follow(std::uint32_t clock, double first_byte, double least_delay);
  double read(std::uint32_t clock, double host);
  bool isHosts(double own, double host);
  bool isEarly(const Point& point, double doubt) const;
  bool isLateForLong(const Point& point, double host);
  void measureSendDelay(double device);

  TimeMode mode_;
  State state_;
  Envelope envelope_;  // of the sensor's time [s], host's time less the sensor's [s]
  std::optional<Reading> last_;
  std::optional<std::uint32_t> newest_;  // [ms] clock of the last scan
  std::optional<Stamped> stamped_;
  std::optional<Own> own_;  // while the sensor's clock is the host's
  std::optional<Late> late_;
  std::optional<Calibration> calibration_;
};

}  // namespace kurumaisu::laser
