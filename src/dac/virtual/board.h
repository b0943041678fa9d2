// SPDX-License-Identifier: BSD-3-Clause
// A simulated serial D/A board: for tests, for the guard's benchmark, and for whoever writes a template.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "dac/settings.h"
#include "dac/virtual/faults.h"
#include "dac/virtual/outputs.h"
#include "dac/virtual/reader.h"
#include "virtual_urg/pty.h"
#include "virtual_urg/wake.h"

namespace kurumaisu::dac {

/// Runs from its construction to its end, in a thread of its own. Holds its voltages whatever happens to its owner.
class VirtualBoard {
 public:
  /// link: of the terminal. log: a file for lines "TIME volts V_f V_s V_ref", "TIME unplugged", "TIME plugged", TIME in
  /// ns of CLOCK_MONOTONIC; empty for none. Throws std::invalid_argument for a device that is not serial,
  /// std::system_error.
  VirtualBoard(const Device& device, const std::string& link, const std::string& log);
  ~VirtualBoard();
  VirtualBoard(const VirtualBoard&) = delete;
  VirtualBoard& operator=(const VirtualBoard&) = delete;

  /// From then on; several may wait for their commands. Text as boardFault() reads it.
  void inject(const std::string& fault);

  /// All changes so far.
  std::vector<Change> history() const;

  /// What it puts out; all pins are at code 0 before the first command.
  Volts volts() const;
  std::array<int, kSignals> codes() const;

  /// Are V_f and V_s 0 V to the nearest code, and is the reference within its clamp?
  bool isNeutral(const Volts& volts) const { return outputs_.isNeutral(volts); }

  std::uint64_t commands() const;          ///< heard
  std::uint64_t misheard() const;          ///< of those, not understood
  std::vector<std::string> heard() const;  ///< the commands themselves

  /// Waits until something of the above is so; false if it is not within so long [s].
  bool wait(const std::function<bool()>& so, double timeout) const;

 private:
  struct Reply {
    double at;  // [s] steady
    std::string bytes;
  };

  void run();
  void serve(std::unique_lock<std::mutex>& lock);
  void receive();
  void obey(const std::string& line);
  void unplug(double seconds);
  void flush(double now);
  const BoardFault* faultNow(const std::optional<BoardReader::Heard>& heard) const;

  const SerialSettings settings_;
  const BoardReader reader_;
  Outputs outputs_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  virtual_urg::Pty pty_;
  virtual_urg::Wake wake_;
  std::vector<std::string> heard_;
  std::vector<BoardFault> faults_;
  std::vector<Reply> replies_;  // not yet sent
  std::string input_;
  std::uint64_t commands_ = 0;
  std::uint64_t misheard_ = 0;
  double stalled_until_ = 0;  // [s] steady
  double back_at_ = 0;        // [s] steady; 0: it is plugged in
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace kurumaisu::dac
