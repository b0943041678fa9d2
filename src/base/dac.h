// SPDX-License-Identifier: BSD-3-Clause
// The three voltages of the joystick, and who puts them out.
#pragma once

namespace kurumaisu {

/// One sample for the D/A converter, and the rates that it stands for.
struct Output {
  double translation;  ///< V_f [V], equation (1)
  double steering;     ///< V_s [V], equation (2)
  double reference;    ///< the joystick's constant third voltage [V]
  double v;            ///< [m/s]
  double w;            ///< [rad/s]
};

/// A D/A converter, or what stands for one.
class Dac {
 public:
  virtual ~Dac() = default;

  /// Holds these voltages until the next call. Returns what it really holds, and the rates that this stands for.
  virtual Output put(const Output& output) = 0;

  /// For how long [s] it holds them if no call comes; then it is neutral.
  virtual double patience() const = 0;
};

}  // namespace kurumaisu
