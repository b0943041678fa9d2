// SPDX-License-Identifier: BSD-3-Clause
// Commands in, voltages and odometry out. No ROS: time is an argument, the D/A converter an interface.
#pragma once

#include <cstdint>
#include <optional>

#include "base/dac.h"
#include "base/reckoning.h"
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

/// Largest rates that are put out; all positive.
struct Limits {
  double v_forward;  ///< [m/s]
  double v_reverse;  ///< [m/s]
  double w;          ///< [rad/s], to either side
};

struct DriveSettings {
  VoltageLaw law;
  double reference_voltage;  ///< [V]
  Limits limits;
  double command_timeout;  ///< a command older than this is none [s]
  OdometryNoise noise;
  std::optional<GyroSettings> gyro{};  ///< nothing: odometry is open loop
};

/// Events since the start, for diagnostics.
struct DriveCounts {
  std::uint64_t samples = 0;      ///< put out
  std::uint64_t ambiguous = 0;    ///< of those, with a voltage that stands for two rates
  std::uint64_t commands = 0;     ///< received
  std::uint64_t refused = 0;      ///< of those, not finite
  std::uint64_t clamped = 0;      ///< of those, beyond a limit
  std::uint64_t ignored = 0;      ///< of those, with components that a chair cannot obey
  std::uint64_t timeouts = 0;     ///< commands to move that ran out: the chair was stopped
  std::uint64_t time_resets = 0;  ///< times that the clock ran backwards
};

/// Turns commands into voltages and keeps the odometry of what was really put out.
///
/// Neutral is 0 V on both axes. It is put out at the start, without a valid command, and after the clock ran
/// backwards, when command and odometry start afresh.
class Drive {
 public:
  enum class Tick { kFirst, kRepeated, kAdvanced, kReset };

  /// Puts out neutral. The converter must outlive this object.
  Drive(const DriveSettings& settings, Dac& dac);

  /// Takes the command v [m/s], w [rad/s] at time t [s]. A command that is not finite is refused (false): it
  /// neither moves the chair nor keeps the last command alive.
  bool command(double v, double w, double t);

  /// Counts a command that also asks for what a chair cannot do, such as driving sideways.
  void countIgnored() { ++counts_.ignored; }

  /// Integrates the last output up to t [s], then puts out what the command asks for.
  Tick tick(double t);

  /// From now, time t [s], odometry goes on from that pose; what the chair does stays as it is.
  void place(const Pose2D& pose, const Eigen::Matrix3d& covariance, double t);

  /// Drops the command and puts out neutral at time t [s].
  void stop(double t);

  const Output& output() const { return output_; }
  const Odometry& odometry() const { return reckoning_.odometry(); }
  Reckoning& reckoning() { return reckoning_; }
  const Reckoning& reckoning() const { return reckoning_; }
  const DriveCounts& counts() const { return counts_; }
  bool hasCommand() const { return command_.has_value(); }
  const std::optional<Band>& translationBand() const { return translation_band_; }
  const std::optional<Band>& steeringBand() const { return steering_band_; }

 private:
  struct Command {
    double v;
    double w;
    double t;
  };

  Tick advanceTo(double t);
  void put(double v, double w);

  DriveSettings settings_;
  Dac& dac_;
  std::optional<Band> translation_band_;
  std::optional<Band> steering_band_;
  Reckoning reckoning_;
  DriveCounts counts_;
  Output output_{};
  std::optional<Command> command_;
  std::optional<double> last_tick_;
};

}  // namespace kurumaisu
