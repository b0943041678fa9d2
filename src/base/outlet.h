// SPDX-License-Identifier: BSD-3-Clause
// From rates to the voltages that can be put out, and what those stand for. No ROS.
#pragma once

#include <cstdint>
#include <optional>

#include "base/dac.h"
#include "model/voltage_law.h"

namespace kurumaisu {

/// Voltages between which two rates answer.
struct Band {
  double low;   ///< [V]
  double high;  ///< [V]

  /// True for a voltage that stands for two rates; 0 V never does, it is rest.
  bool contains(double volts) const { return volts > low && volts < high && volts != 0; }
};

/// Where the branches of a law overlap; empty for a law with an ordinary dead zone.
std::optional<Band> ambiguousBand(const AxisLaw& law);

/// What a channel of the D/A converter can put out.
struct Channel {
  double min;         ///< [V]
  double max;         ///< [V]
  double resolution;  ///< volts per code, 0 V being one of them; 0: any voltage

  /// The nearest voltage that a knob at this share leaves; half codes go to the even one.
  double nearest(double volts, double knob) const;
};

struct OutletSettings {
  VoltageLaw law;
  Channel translation;
  Channel steering;
  double knob;               ///< share of both bands that the speed knob leaves, above 0 to 1
  double reference_voltage;  ///< [V]
};

/// Throws std::invalid_argument for a channel, or a law on it, that cannot drive: neutral (0 V) or the dead zone
/// outside the band that the knob leaves, or codes too coarse for it.
void validate(const AxisLaw& law, const Channel& channel, double knob);

/// Throws std::invalid_argument unless volts grow (or fall) with the rate throughout, through rest as well: the
/// branches must not overlap, and 0 V must lie in the dead zone between them.
void validateMonotonic(const AxisLaw& law);

/// Makes samples for the converter and counts what they had to give up.
class Outlet {
 public:
  explicit Outlet(const OutletSettings& settings);

  /// The sample nearest to these rates; its v and w are what its voltages stand for.
  Output at(double v, double w);

  struct Counts {
    std::uint64_t samples = 0;
    std::uint64_t ambiguous = 0;  ///< of those, with a voltage that stands for two rates
    std::uint64_t clamped = 0;    ///< of those, with a voltage that the band cut
  };
  const Counts& counts() const { return counts_; }
  const OutletSettings& settings() const { return settings_; }
  const std::optional<Band>& translationBand() const { return translation_band_; }
  const std::optional<Band>& steeringBand() const { return steering_band_; }

 private:
  OutletSettings settings_;
  std::optional<Band> translation_band_;
  std::optional<Band> steering_band_;
  AxisInverse translation_inverse_;
  AxisInverse steering_inverse_;
  Counts counts_;
};

}  // namespace kurumaisu
