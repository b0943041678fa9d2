// SPDX-License-Identifier: BSD-3-Clause
// Equations (1) and (2): rates to joystick voltages and back.
#pragma once

#include <cstdint>
#include <optional>

namespace kurumaisu {

/// One side of a law: volts = slope * rate + intercept.
struct Branch {
  double slope;      ///< [V s/m] for translation, [V s/rad] for steering; never 0
  double intercept;  ///< [V]
};

/// Voltage law of one axis: one branch for each sign of the rate, and 0 V at rate 0.
///
/// Either branch may leave a gap around 0 V (an ordinary dead zone, equation (1)) or overlap the other
/// (equation (2) as printed). In an overlap a voltage stands for two rates: see AxisInverse.
struct AxisLaw {
  Branch positive;
  Branch negative;

  /// Volts that stand for a rate [m/s or rad/s].
  double volts(double rate) const;

  /// Rate that the positive (negative) branch assigns to volts; empty where the branch does not reach them.
  std::optional<double> positiveRate(double volts) const;
  std::optional<double> negativeRate(double volts) const;

  /// True where both branches answer, that is, where volts alone do not determine the rate.
  bool ambiguous(double volts) const;

  /// Rate per volt on the branch of this sign [m/s/V or rad/s/V]; rate 0 counts as positive.
  double gain(double rate) const { return 1.0 / (rate < 0 ? negative.slope : positive.slope); }
};

/// Throws std::invalid_argument unless both slopes are finite, not 0 and of the same sign.
void validate(const AxisLaw& law);

/// Single-valued inverse of an AxisLaw along a sequence of samples.
///
/// Where both branches answer, in this order: the commanded sign when the sample carries it, else the branch
/// of the last unambiguous sample, else the smaller rate. 0 V is rate 0. Where no branch answers (a dead
/// zone) the rate is 0.
class AxisInverse {
 public:
  explicit AxisInverse(const AxisLaw& law) : law_(law) {}

  /// Rate for volts; commanded_sign is -1, 0 or +1, or empty when the sample does not carry it.
  double rate(double volts, std::optional<int> commanded_sign = std::nullopt);

  /// Samples so far that both branches answered.
  std::uint64_t ambiguousSamples() const { return memory_.ambiguous_samples; }

  /// All that the next rates depend on, beside the law.
  struct Memory {
    int last_sign = 0;
    std::uint64_t ambiguous_samples = 0;
  };
  Memory memory() const { return memory_; }
  void recall(const Memory& memory) { memory_ = memory; }

 private:
  double choose(double positive, double negative, std::optional<int> commanded_sign) const;

  AxisLaw law_;
  Memory memory_;
};

/// Equations (1) and (2) together.
struct VoltageLaw {
  AxisLaw translation;  ///< forward speed [m/s] to V_f [V]
  AxisLaw steering;     ///< yaw rate [rad/s] to V_s [V]
};

}  // namespace kurumaisu
