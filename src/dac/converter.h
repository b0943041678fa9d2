// SPDX-License-Identifier: BSD-3-Clause
// A D/A converter that stands in for the joystick: three voltages, and what may go wrong with them. No ROS.
#pragma once

#include <stdexcept>
#include <string>

namespace kurumaisu::dac {

/// What the joystick's plug carries, as equations (1) and (2) count: translation and steering from the reference.
struct Volts {
  double translation;  ///< V_f [V]; 0 is neutral
  double steering;     ///< V_s [V]; 0 is neutral
  double reference;    ///< [V]
};

/// The device does not answer, answers wrongly, or cannot be written. The message names device and channel.
class Fault : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One open device, owned exclusively. Whoever calls decides what a fault means; a converter never moves by itself.
class Converter {
 public:
  Converter() = default;
  Converter(const Converter&) = delete;
  Converter& operator=(const Converter&) = delete;
  virtual ~Converter() = default;

  /// One step towards the first voltage, of some replies' time at most: a device that was opened may have to boot, to
  /// identify itself and to be told how to work. True once voltages can be put out. Throws Fault.
  virtual bool prepare() { return true; }

  /// Puts out all three, the reference first, and returns what the device now holds: clamped to the channel's band
  /// and rounded to its codes. Throws Fault when that is not known; std::invalid_argument for a value not finite.
  virtual Volts put(const Volts& volts) = 0;

  /// Closes and opens the device anew, for example after it was unplugged; prepare() comes next. Throws Fault.
  virtual void reopen() = 0;

  /// What it is, for logs and diagnostics: kind, device, identity.
  virtual std::string name() const = 0;
};

}  // namespace kurumaisu::dac
