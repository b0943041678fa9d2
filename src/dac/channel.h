// SPDX-License-Identifier: BSD-3-Clause
// Volts to codes and back, with the clamp that nothing above can lift.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "dac/converter.h"

namespace kurumaisu::dac {

struct Band {
  double min;
  double max;
};

/// In the order in which they are written: the chair must not see V_f and V_s against a wrong reference.
enum Signal : std::size_t { kReference, kTranslation, kSteering };
constexpr std::size_t kSignals = 3;
constexpr std::array<Signal, kSignals> kWriteOrder{kReference, kTranslation, kSteering};
constexpr std::array<const char*, kSignals> kSignalNames{"reference", "translation", "steering"};

/// code = per_volt * V + at_zero, V [V] at the pin.
struct Coding {
  double per_volt;  ///< [1/V], not 0
  double at_zero;
  int min;
  int max;
};

struct Channel {
  Band volt;           ///< [V] hard clamp, of the voltage as Volts counts it
  bool add_reference;  ///< is the pin's voltage that much above the reference's? Not of the reference itself.
};

/// What one channel gets.
struct Level {
  int code;
  double pin;   ///< [V] at the pin, of the code
  double volt;  ///< [V] the same as Volts counts it
};

using Levels = std::array<Level, kSignals>;
using Channels = std::array<Channel, kSignals>;
using Codings = std::array<Coding, kSignals>;

/// The codes for voltages, and what they really are: within the clamp, unless even the nearest code is outside.
///
/// Throws std::invalid_argument for a voltage that is not finite.
Levels levelsOf(const Volts& volts, const Channels& channels, const Codings& codings);

Volts voltsOf(const Levels& levels);

/// Why these do not fit together, naming the signal; empty if they do: the codes reach wherever the clamp allows, the
/// clamp of V_f and V_s has neutral in it, and is at least one code wide.
std::string misfit(const Channels& channels, const Codings& codings);

}  // namespace kurumaisu::dac
