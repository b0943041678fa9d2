// SPDX-License-Identifier: BSD-3-Clause
// What is inside a Device.
#pragma once

#include <deque>
#include <set>
#include <string>
#include <vector>

#include "virtual_urg/commands.h"
#include "virtual_urg/device.h"
#include "virtual_urg/frames.h"

namespace kurumaisu::virtual_urg {

struct Device::State {
  /// Throws std::invalid_argument for a model that contradicts itself.
  State(Model kind, std::vector<Fault> all);

  std::uint32_t clockAt(double time) const;
  double scanTime() const;
  void restartClock(double now);
  bool isDeaf(double now) const;
  void powerUp(double now, double boot_time);

  /// Commands, in device.cpp. A line may be refused unread, wait for a rotation, or be carried out.
  void hear(const std::string& line, double now, Output& output);
  void carryOut(const std::string& line, double now, Output& output);

  /// Rotations, in scanning.cpp.
  void answerSingle(const Measurement& measurement, double now, Output& output);
  void continueStream(const Measurement& measurement, double now, Output& output);
  void send(Order& order, const Measurement& measurement, double now, Output& output);
  std::string frame(const Order& order, const Measurement& measurement, int scan);
  std::string playedStatus(const Order& order);
  void strike(int scan, double now, Output& output);

  const Model model;
  const scip::Parameters parameters;
  const Faults faults;
  const Commands commands{model, parameters, faults};
  Memory memory = fresh(model, faults);
  Clock clock;
  double clock_zero = 0;            // [s] world's time at clock.start
  double deaf_until = 0;            // [s]
  std::string input;                // a line not yet complete
  std::set<std::string> heard;      // names of the commands that came in one go
  std::deque<std::string> waiting;  // commands behind one that waits for a rotation
  Counts counts;
  std::uint64_t connections = 0;
  int versions = 0;  // VV, in this connection, or since it was deaf
};

}  // namespace kurumaisu::virtual_urg
