// SPDX-License-Identifier: BSD-3-Clause
// What a number from outside may be: the one table of plausible ranges, for every node, in C++ and in Python
// (kurumaisu._core). A finite number may still make no sense: 1e300 m is finite, and its square is not.
#pragma once

#include <string>

namespace kurumaisu {

struct Quantity {
  const char* name;
  const char* unit;
  double least;
  double most;
};

namespace plausible {

inline constexpr Quantity kPosition{"position", "m", -1e7,
                                    1e7};                     ///< the earth's quarter: as far as UTM counts
inline constexpr Quantity kAngle{"angle", "rad", -1e4, 1e4};  ///< 1600 turns; the sine still has 12 digits
inline constexpr Quantity kVariance{"variance", "m^2 or rad^2", 0,
                                    1e6};  ///< who knows nothing says 1e6 at most
inline constexpr Quantity kSpeed{"speed", "m/s", -100, 100};
inline constexpr Quantity kYawRate{"yaw rate", "rad/s", -100, 100};  ///< a gyro of 2000 deg/s ends at 35
inline constexpr Quantity kVoltage{"voltage", "V", -30, 30};  ///< two batteries of 12 V while they charge
inline constexpr Quantity kStamp{"stamp", "s", 0, 4e9};       ///< ros::Time ends at 4.29e9, and throws beyond
inline constexpr Quantity kDuration{"duration", "s", -10, 10};        ///< of a scan's sweep
inline constexpr Quantity kRange{"range", "m", 0, 1000};              ///< of a laser
inline constexpr Quantity kResolution{"resolution", "m", 1e-4, 100};  ///< edge of a map's cell
/// Simulated seconds per second; beside 0, which means as fast as possible.
inline constexpr Quantity kPace{"simulation speed", "s/s", 1e-6, 1e6};

inline constexpr Quantity kAll[] = {kPosition, kAngle,    kVariance, kSpeed,      kYawRate, kVoltage,
                                    kStamp,    kDuration, kRange,    kResolution, kPace};

}  // namespace plausible

/// Throws std::invalid_argument with what is expected and what came unless the value is in the quantity's range; NaN
/// is in none. what: its name where it came from.
void require(const Quantity& quantity, const std::string& what, double value);

/// The quantity of a name. Throws std::invalid_argument for another one.
const Quantity& quantityOf(const std::string& name);

/// The name of a frame without the slash that ROS before 2012 put in front of it, and tf2 rejects.
std::string frameOf(const std::string& name);

}  // namespace kurumaisu
