// SPDX-License-Identifier: BSD-3-Clause
// A virtual sensor at an endpoint, served by a thread of its own.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "virtual_urg/device.h"
#include "virtual_urg/endpoint.h"
#include "virtual_urg/outbox.h"
#include "virtual_urg/wake.h"

namespace kurumaisu::virtual_urg {

/// Whose time it is.
enum class Pace {
  kReal,  ///< the mirror turns by the steady clock; a turn measures what was last shown
  kFed,   ///< time and turns come from measure() and advance()
};

/// What happened so far.
struct Counters {
  std::uint64_t clients = 0;
  std::uint64_t bytes_in = 0;
  std::uint64_t bytes_out = 0;
  std::uint64_t garbled = 0;  ///< of those in and out, bytes at the wrong rate
  std::uint64_t unheard = 0;  ///< scans made while nobody was there
  std::uint64_t dropped = 0;  ///< scans the client left no room for
  std::uint64_t late = 0;     ///< turns left out because this computer was too busy
  Counts device;
};

/// Runs from its construction to its end. Safe to call from several threads.
class Server {
 public:
  /// patience [s]: how long measure() waits for a client that does not read. line_rate: bytes take the time that the
  /// sensor's bit rate gives them.
  struct Options {
    Pace pace = Pace::kReal;
    double patience = 0;
    bool line_rate = false;
  };

  Server(Model model, std::vector<Fault> faults, const Clock& clock, std::unique_ptr<Endpoint> endpoint,
         const Options& options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Real time: what turns measure from now on. Throws std::invalid_argument for vectors of a wrong size.
  void show(Measurement measurement);

  /// Fed: a turn is complete, at a time [s] that is not before any told earlier. False if a scan was dropped.
  bool measure(const Measurement& measurement, double now);

  /// Fed: what time it is [s].
  void advance(double now);

  void powerCycle();
  void close();

  std::string address() const;
  bool connected() const;
  Counters counters() const;
  int baud() const;

 private:
  static constexpr double kBitsOfByte = 10;  // on a serial line: start, 8 data, stop

  void run();
  void serve();
  void checkAlive() const;

  double wakeAt(double now);
  double deviceTime() const;
  void turn(double now);
  void begin(double now);
  void heed();
  void flush(double now);
  std::optional<std::size_t> send(std::string_view bytes);
  bool post(Output output, int baud, bool is_scan);
  void apply(const Output& output);
  void gone();
  void makeRoom();

  const Options options_;
  const std::size_t steps_;  // of a measurement
  mutable std::mutex mutex_;
  std::condition_variable room_;  // the outbox is empty, or there is nobody to read it
  Device device_;
  std::unique_ptr<Endpoint> endpoint_;
  Outbox outbox_;
  Counters counters_;
  Measurement shown_;
  double fed_time_ = 0;  // [s]
  double turn_start_;    // [s] steady, of the turn that is measured next
  double back_at_;       // [s] steady, when the device is plugged in again
  bool patient_ = true;  // measure() may wait
  bool full_ = false;    // the client's system takes no more for now
  bool stopping_ = false;
  std::exception_ptr failure_;  // that ended the thread
  Wake wake_;
  std::thread thread_;
};

}  // namespace kurumaisu::virtual_urg
