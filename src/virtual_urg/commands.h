// SPDX-License-Identifier: BSD-3-Clause
// What a sensor answers to a command, and what the command changes in it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "scip/request.h"
#include "scip/sensor.h"
#include "virtual_urg/faults.h"
#include "virtual_urg/model.h"

namespace kurumaisu::virtual_urg {

/// A measurement that was asked for.
struct Order {
  scip::Request request;
  std::string text;    ///< the command, as it came
  std::string label;   ///< `;string` of the command, or empty
  int sent = 0;        ///< scans of it
  int turns_left = 0;  ///< of the mirror until the next one that is sent
};

/// What DB has the sensor play (C-42-03320B, 8.10).
enum class Play { kNone = 0, kBroken11 = 1, kBroken20 = 2, kRecovers = 3, kFails = 4, kFailsAtOnce = 5 };

/// All that changes while a sensor is on.
struct Memory {
  int protocol = 2;  ///< 1: SCIP 1.1
  int baud = 0;      ///< [bit/s]
  bool laser = false;
  bool adjusting = false;  ///< TM0: it tells its time and nothing else
  bool sensitive = false;  ///< HS1
  int slowness = 0;        ///< [%] of the motor, by CR
  bool broken = false;     ///< the laser does not light
  bool ill = false;        ///< the last status was one of trouble
  Play play = Play::kNone;
  bool restarts_clock = false;  ///< RS: from now on it counts from 0
  std::optional<Order> stream;  ///< MD, MS, ME
  std::optional<Order> single;  ///< GD, GS, GE: the next rotation answers it

  void darken();  ///< laser off, and with it all measurements
};

/// As it is when power comes on.
Memory fresh(const Model& model, const Faults& faults);

/// A command, taken apart.
struct Command {
  std::string_view echo;   ///< all of it
  std::string_view text;   ///< without `;string`
  std::string_view label;  ///< `;string`, or empty

  explicit Command(std::string_view line);
  std::string_view name() const { return text.substr(0, 2); }
  std::string_view arguments() const { return text.size() > 2 ? text.substr(2) : std::string_view(); }
};

/// Answers commands. What it refers to must outlive it.
class Commands {
 public:
  Commands(const Model& model, const scip::Parameters& parameters, const Faults& faults)
      : model_(model), parameters_(parameters), faults_(faults) {}

  /// The reply to a line, at a time of the sensor's clock [ms]; empty where a rotation will bring it.
  std::string answer(std::string_view line, Memory& memory, std::uint32_t clock) const;

 private:
  std::string answer11(const Command& command, Memory& memory) const;
  std::string status(const Command& command, Memory& memory) const;
  std::string measure(const Command& command, Memory& memory) const;
  std::string body(const Command& command, const Memory& memory, std::uint32_t clock) const;
  std::string versionBody() const;
  std::string parametersBody() const;
  std::string stateBody(const Memory& memory, std::uint32_t clock) const;

  const Model& model_;
  const scip::Parameters& parameters_;
  const Faults& faults_;
};

}  // namespace kurumaisu::virtual_urg
