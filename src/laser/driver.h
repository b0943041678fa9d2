// SPDX-License-Identifier: BSD-3-Clause
// The laser's driver: finds the sensor, keeps it streaming, says how it does. No ROS: time and sink are given.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "laser/fan.h"
#include "laser/scan.h"
#include "laser/status.h"

namespace kurumaisu::laser {

/// What may change while the driver runs.
using LiveSettings = Window;

struct DriverSettings {
  std::string serial_port;  ///< a tty; empty with ip_address
  int serial_baud;          ///< [baud] on RS-232; USB ignores it
  std::string ip_address;   ///< in numbers; empty with serial_port
  int ip_port;
  LiveSettings live;
  bool calibrate_time;  ///< ask the sensor's clock (TM) at each start; its laser is off meanwhile
  TimeMode time_mode;
  double stale_timeout;    ///< [s] of the host's time without a scan: the sensor is sought anew
  int error_limit;         ///< damaged scans and errors in a row: the sensor is sought anew
  double connect_timeout;  ///< [s] for a TCP connection
  double answer_timeout;   ///< [s] for a command's answer
  double retry_min;        ///< [s] from one attempt to connect to the next, rising ...
  double retry_max;        ///< [s] ... to this while there is no port
};

/// Runs a sensor in a thread of its own. All functions may be called from any thread but the sink.
class Driver {
 public:
  using Now = std::function<double()>;             ///< the host's time [s], real or simulated
  using Sink = std::function<void(const Scan&)>;   ///< called from the driver's thread
  using Log = std::function<void(const Report&)>;  ///< what happened, as it happens; from the driver's thread

  /// Throws std::invalid_argument naming the setting that is out of range or contradicts another.
  Driver(DriverSettings settings, Sink sink, Now now, Log log);
  ~Driver();
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;

  void start();

  /// Ends within 0.2 s plus the time that the sink takes, whatever the sensor does.
  void stop();

  /// Asks for another window from the next scan on. Throws std::invalid_argument naming the setting that the
  /// sensor, if it is known, cannot do; nothing changes then.
  void reconfigure(const LiveSettings& live);

  /// Lets go of the port and begins anew.
  void restart();

  Status status() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kurumaisu::laser
