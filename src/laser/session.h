// SPDX-License-Identifier: BSD-3-Clause
// One connection to a sensor, from the open port until it is lost.
#pragma once

#include <functional>
#include <memory>

#include "laser/clock.h"
#include "laser/driver.h"
#include "laser/fan.h"
#include "laser/handshake.h"
#include "laser/link.h"
#include "laser/monitor.h"
#include "laser/sequence.h"
#include "laser/stream.h"
#include "laser/urg.h"

namespace kurumaisu::laser {

/// What outlives a connection.
struct Memory {
  DeviceClock clock;
  Sequence sequence;
  std::string serial;           ///< number of the sensor that the clock belongs to
  bool wedged = false;          ///< it fell silent when asked for intensities
  int starts_without_scan = 0;  ///< in a row
  bool has_streamed = false;
  bool ask_once = false;  ///< asked again after a wrong sum it fell silent
};

/// What a session is given; all of it must outlive the session.
struct Surroundings {
  const DriverSettings& settings;
  const Driver::Sink& sink;
  const Driver::Now& now;
  Control& control;
  Monitor& monitor;
  Memory& memory;
};

class Session {
 public:
  /// Opens the port. Throws LinkLost.
  explicit Session(const Surroundings& surroundings);

  /// Quiets the sensor, if it still listens.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Streams until something ends it. Throws LinkLost, Refused; std::invalid_argument for a window or a timeout that
  /// does not fit the sensor.
  void run();

 private:
  struct Watch {
    double scan;         // [s] host's time of the last one, or of the start
    double steady_scan;  // [s] the same in steadyTime()
    int errors = 0;      // since then
  };

  void shake();
  void identify();
  std::unique_ptr<Urg> start(std::shared_ptr<ScipStream>& stream);
  std::unique_ptr<Urg> startForm(std::shared_ptr<ScipStream>& stream, const Window& window);
  bool streamUntilQuiet(Urg& urg, ScipStream& stream);
  void handle(const Arrival& arrival, Urg& urg, Watch& watch);
  void checkClock(std::uint32_t clock, double first_byte);
  void publish(const scip::Rotation& rotation, double first_byte);
  void complain(const Arrival& arrival);
  bool isQuiet(Watch& watch) const;
  void updateCounts();

  Surroundings with_;
  Link link_;
  const Tell tell_;
  const Counts before_;  // of earlier connections
  Sensor sensor_;
  std::unique_ptr<Fan> fan_;
  double period_ = 0;             // [s] from scan to scan
  bool is_first_ = true;          // the next scan is the first one of a sensor just asked what it is
  std::uint64_t unreadable_ = 0;  // replies that have been told of
};

}  // namespace kurumaisu::laser
