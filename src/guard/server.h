// SPDX-License-Identifier: BSD-3-Clause
// The guard's process: one device, one client, and the time in between.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "file_descriptor.h"
#include "guard/device.h"
#include "guard/guard.h"
#include "guard/settings.h"
#include "signals.h"
#include "sleep_watch.h"

namespace kurumaisu::guard {

/// Puts out what the guard allows: neutral until a client has armed it, and again when anything is wrong. It waits
/// for nothing but the device, which answers or fails within its own timeout.
class Server {
 public:
  using Beat = std::function<bool()>;

  /// beat: called in every round, as a sign of life; false: nobody watches over this process any more. Throws where
  /// the socket cannot be had.
  Server(const Settings& settings, Device::Open open, Beat beat);

  /// Works until a signal says to end, isToEnd(); neutral is the last thing put out.
  void run();

 private:
  void wait();
  void begin();
  bool isTold();
  void look();
  void acceptClients();
  Descriptor acceptClient();
  void listen();
  void take(const void* bytes, std::size_t size, double now);
  void drop();
  void write(double now);
  void put(const dac::Volts& volts, double now);
  void recover(double now);
  void answer();
  void report();
  std::string reacted() const;

  Settings settings_;
  Beat beat_;
  Signals signals_;
  int told_ = 0;  ///< the signal that says to end
  SleepWatch sleep_;
  Guard guard_;
  Device device_;
  Descriptor listener_;
  Descriptor client_;
  Descriptor reserve_;                  ///< given up where none is left for one more who connects
  double accept_at_ = 0;                ///< [s] not to be tried before
  bool client_left_ = false;            ///< says poll(): what it still sent is not to be read
  std::optional<std::uint64_t> asked_;  ///< sequence of a message that is not answered yet
  std::optional<dac::Volts> written_;   ///< what the device was last asked for; none: write at once
  double written_at_ = 0;               ///< [s]
  double noticed_ = 0;                  ///< [s] what there is to notice in this round
  double held_at_ = 0;                  ///< [s] the device confirmed what was last written
  State reported_ = State::kIdle;
  std::string reported_problem_;
};

}  // namespace kurumaisu::guard
