// SPDX-License-Identifier: BSD-3-Clause
// What a virtual board puts out, and the log of it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "dac/settings.h"
#include "file_descriptor.h"

namespace kurumaisu::dac {

/// What its outputs became, and when.
struct Change {
  std::int64_t time;  ///< [ns] CLOCK_MONOTONIC, when the command had been read
  Volts volts;        ///< the reference as the pin has it, the others as they are counted
};

/// All pins are at code 0 before the first command.
class Outputs {
 public:
  /// log: a file to which lines are added; empty for none. Throws std::system_error.
  Outputs(const Channels& channels, const Codings& codings, const std::string& log);

  void put(const std::vector<std::pair<Signal, int>>& codes);

  /// Logs what has happened.
  void note(const std::string& what) const;

  Volts volts() const;
  const std::array<int, kSignals>& codes() const { return codes_; }
  const std::vector<Change>& history() const { return history_; }
  bool isNeutral(const Volts& volts) const;

 private:
  void log(std::int64_t time, const std::string& what) const;

  const Channels channels_;
  const Codings codings_;
  Descriptor log_;
  std::array<int, kSignals> codes_{};
  std::vector<Change> history_;
};

}  // namespace kurumaisu::dac
