// SPDX-License-Identifier: BSD-3-Clause
// What the guard reads: launch/guard.yaml, and of the model file beside it the bands of the voltages and the reference.
#pragma once

#include <string>

#include "guard/device.h"
#include "guard/guard.h"

namespace kurumaisu::guard {

struct Settings {
  Limits limits;
  std::string socket;       ///< path of the socket for the client
  double period;            ///< [s] after which the output is written again, changed or not
  int priority;             ///< SCHED_FIFO's, of guard and sentinel; 0: none
  BackOff reopening;        ///< of a lost device
  double sentinel_silence;  ///< [s] without a sign of life: the sentinel kills the guard
  double restart_pause;     ///< [s] before a guard that died is started again
  double neutral_patience;  ///< [s] for which `guard --neutral` tries
};

inline Neutral neutralOf(const Limits& limits) {
  return {limits.reference, limits.reference_tolerance, limits.neutral};
}

/// Reads the file, and the model file that it names. Throws std::invalid_argument naming file, line, key and value.
Settings readSettings(const std::string& file);

}  // namespace kurumaisu::guard
