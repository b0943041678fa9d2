// SPDX-License-Identifier: BSD-3-Clause
// How the driver and its sensor do.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "laser/clock.h"
#include "scip/sensor.h"

namespace kurumaisu::laser {

enum class State {
  kStopped,        ///< not started, or stopped
  kConnecting,     ///< there is no port, or no sensor answers on it; tried again and again
  kStarting,       ///< a sensor answers
  kStreaming,      ///< scans come
  kRefused,        ///< the sensor refuses, or says what cannot be; tried again and again
  kMisconfigured,  ///< the sensor cannot do what the settings ask; waits for others
};

/// A state's name for people: "streaming".
const char* name(State state);

/// A sensor's status for people, while it streams.
std::string meaning(const std::string& status);

/// Something to tell: a stable code such as LASER_STALE, then words.
struct Report {
  enum class Level { kInfo, kWarning, kError };
  Level level;
  std::string text;
};

/// Events since the start. They survive reconnects.
struct Counts {
  std::uint64_t scans = 0;        ///< given to the sink
  std::uint64_t lost = 0;         ///< that the sensor's clock says are missing between two of them
  std::uint64_t bad_sums = 0;     ///< lines of any reply
  std::uint64_t unreadable = 0;   ///< replies that are none, or ran into the next one
  std::uint64_t damaged = 0;      ///< scans dropped: wrong sum, length or character
  std::uint64_t duplicates = 0;   ///< scans dropped: of a time that was already there
  std::uint64_t stray_bytes = 0;  ///< between replies
  std::uint64_t reconnects = 0;   ///< times that streaming began again
  std::uint64_t attempts = 0;     ///< to connect
  std::map<std::string, std::uint64_t> errors;  ///< of the sensor, by status ("50")
};

/// The sensor as it presents itself; empty until it has.
struct Device {
  std::map<std::string, std::string> version;  ///< VV: VEND, PROD, FIRM, PROT, SERI
  std::map<std::string, std::string> state;    ///< II: STAT and others
  std::optional<scip::Parameters> parameters;  ///< PP
  int baud = 0;                                ///< [baud] of the tty; 0 on TCP
};

struct Status {
  State state = State::kStopped;
  Counts counts;
  Device device;
  bool intensity = false;      ///< scans hold intensities
  std::string last_error;      ///< the last report that was a warning or an error
  double last_error_time = 0;  ///< [s] host's
  double last_scan_time = 0;   ///< [s] host's, when it was given to the sink
  double latency = 0;          ///< [s] from the last scan's last byte until the sink had it
  DeviceClock::State clock;    ///< the sensor's, as of the last scan
  double scan_period = 0;      ///< [s] from scan to scan, as asked for
};

}  // namespace kurumaisu::laser
