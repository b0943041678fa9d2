// SPDX-License-Identifier: BSD-3-Clause
#include "dac/channel.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace kurumaisu::dac {
namespace {

constexpr double kSlack = 1e-9;       // [codes] a limit that is a code, but for rounding, is that code
constexpr double kHalf = 0.5 + 1e-6;  // [codes] a limit that is rounded to a code

double codeOf(double pin, const Coding& coding) { return coding.per_volt * pin + coding.at_zero; }
double pinOf(int code, const Coding& coding) { return (code - coding.at_zero) / coding.per_volt; }

double valueOf(const Volts& volts, Signal signal) {
  if (signal == kReference) return volts.reference;
  return signal == kTranslation ? volts.translation : volts.steering;
}

/// Codes of a band of pin voltages, in order.
Band codesOf(const Band& pins, const Coding& coding) {
  const double a = codeOf(pins.min, coding);
  const double b = codeOf(pins.max, coding);
  return {std::min(a, b), std::max(a, b)};
}

/// zero: [V] of the pin at which the signal is 0.
Level levelOf(double volt, double zero, const Channel& channel, const Coding& coding) {
  const Band clamp = codesOf({channel.volt.min + zero, channel.volt.max + zero}, coding);
  const double low = std::max<double>(coding.min, std::ceil(clamp.min - kSlack));
  const double high = std::min<double>(coding.max, std::floor(clamp.max + kSlack));
  const double wanted =
      std::round(codeOf(std::clamp(volt, channel.volt.min, channel.volt.max) + zero, coding));
  // a clamp that has no code in it, which misfit() refuses, must not end in a wild one
  const double code = std::clamp<double>(std::min(std::max(wanted, low), high), coding.min, coding.max);
  const double pin = pinOf(static_cast<int>(code), coding);
  return {static_cast<int>(code), pin, pin - zero};
}

std::string misfitOf(Signal signal, const Channel& channel, const Coding& coding, const Band& zero) {
  const std::string name = kSignalNames[signal];
  const Band& volt = channel.volt;
  if (volt.min >= volt.max) return name + ": volt/min must be below volt/max";
  if (signal != kReference && (volt.min > 0 || volt.max < 0)) return name + ": neutral, 0 V, is outside volt";
  if ((volt.max - volt.min) * std::abs(coding.per_volt) < 1) return name + ": volt is narrower than one code";
  const Band codes = codesOf({volt.min + zero.min, volt.max + zero.max}, coding);
  if (codes.min >= coding.min - kHalf && codes.max <= coding.max + kHalf) return "";
  return name + ": volt reaches from code " + std::to_string(codes.min) + " to " + std::to_string(codes.max) +
         ", but codes from " + std::to_string(coding.min) + " to " + std::to_string(coding.max);
}

}  // namespace

Levels levelsOf(const Volts& volts, const Channels& channels, const Codings& codings) {
  Levels levels{};
  for (const Signal signal : kWriteOrder) {
    const double volt = valueOf(volts, signal);
    if (!std::isfinite(volt)) {
      throw std::invalid_argument(std::string(kSignalNames[signal]) +
                                  " is not finite: " + std::to_string(volt));
    }
    const double zero = signal != kReference && channels[signal].add_reference ? levels[kReference].pin : 0;
    levels[signal] = levelOf(volt, zero, channels[signal], codings[signal]);
  }
  return levels;
}

Volts voltsOf(const Levels& levels) {
  return {levels[kTranslation].volt, levels[kSteering].volt, levels[kReference].volt};
}

std::string misfit(const Channels& channels, const Codings& codings) {
  for (const Signal signal : kWriteOrder) {
    const bool added = signal != kReference && channels[signal].add_reference;
    const Band zero = added ? channels[kReference].volt : Band{0, 0};
    std::string reason = misfitOf(signal, channels[signal], codings[signal], zero);
    if (!reason.empty()) return reason;
  }
  return "";
}

}  // namespace kurumaisu::dac
