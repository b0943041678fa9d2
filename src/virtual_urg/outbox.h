// SPDX-License-Identifier: BSD-3-Clause
// What the sensor has said and the client's system has not yet taken.
#pragma once

#include <cstddef>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "virtual_urg/device.h"

namespace kurumaisu::virtual_urg {

/// Outputs in their order, each as fast as it may go. Times are of a steady clock [s].
class Outbox {
 public:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  bool empty() const { return parcels_.empty(); }

  /// May a scan be added? A sensor measures the next one while one goes out, and has no memory for more.
  bool takesScan() const { return scans_ < kScans; }

  /// May more commands be answered?
  bool takesReply() const { return bytes_ < kCapacity; }

  /// At a rate [bit/s], 0: none.
  void add(Output output, int baud, bool is_scan);

  /// What may go now: a part of the first output, perhaps nothing. The time of an output begins with its first call.
  std::string_view due(double now);

  /// When there is more to go than now; kNever if nothing is left of the first output.
  double next() const;

  /// The rate of what is due [bit/s]; 0: none.
  int baud() const { return parcels_.front().baud; }

  /// So many of the due bytes went.
  void sent(std::size_t bytes);

  /// The first output, once all of it has gone; it is then forgotten.
  std::optional<Output> finished();

  void clear();

 private:
  struct Parcel {
    Output output;
    int baud = 0;
    bool is_scan = false;
    std::size_t sent = 0;
    std::optional<double> began;  // [s]
  };

  static constexpr int kScans = 2;
  static constexpr std::size_t kCapacity = 16384;  // [bytes]: a scan of any kind, and replies

  std::deque<Parcel> parcels_;
  std::size_t bytes_ = 0;  // not yet sent
  int scans_ = 0;
};

}  // namespace kurumaisu::virtual_urg
