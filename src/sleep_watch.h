// SPDX-License-Identifier: BSD-3-Clause
// Notices that this computer was suspended. The steady clock stands meanwhile: what is hours old looks fresh.
#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include "steady.h"

namespace kurumaisu {

class SleepWatch {
 public:
  using Slept = std::function<std::int64_t()>;  ///< [ns] since the computer's start

  explicit SleepWatch(Slept slept = sleptNanoseconds) : slept_(std::move(slept)), last_(slept_()) {}

  /// Whether it was suspended since the last call.
  bool hasSlept() {
    const std::int64_t now = slept_();
    const std::int64_t before = std::exchange(last_, now);
    return now - before > kShortest;
  }

 private:
  static constexpr std::int64_t kShortest = 50'000'000;  // [ns]: two clocks are not read at one time

  Slept slept_;
  std::int64_t last_;
};

}  // namespace kurumaisu
