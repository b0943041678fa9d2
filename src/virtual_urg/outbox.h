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

  /// May one more of this size be kept? The first always may.
  bool fits(std::size_t bytes) const { return empty() || bytes_ + bytes <= kCapacity; }

  /// At a rate [bit/s], 0: none.
  void add(Output output, int baud);

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
    std::size_t sent = 0;
    std::optional<double> began;  // [s]
  };

  // [bytes] About as much as a sensor can keep: two scans of 1081 beams with intensities.
  static constexpr std::size_t kCapacity = 16384;

  std::deque<Parcel> parcels_;
  std::size_t bytes_ = 0;  // not yet sent
};

}  // namespace kurumaisu::virtual_urg
