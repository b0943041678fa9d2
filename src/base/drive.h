// SPDX-License-Identifier: BSD-3-Clause
// Commands in, voltages and odometry out. No ROS: time is an argument, the D/A converter an interface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/arbiter.h"
#include "base/dac.h"
#include "base/estop.h"
#include "base/limiter.h"
#include "base/odometry/reckoning.h"
#include "base/outlet.h"
#include "base/speed_cap.h"

namespace kurumaisu {

struct DriveSettings {
  ArbiterSettings arbiter;
  double estop_timeout;  ///< EStop's [s]
  SpeedCapSettings cap;
  std::vector<Limits> limits;  ///< sets that the inputs choose from
  double longest_step;         ///< a tick later than this moves the ramps on by no more [s]
  OutletSettings outlet;
  OdometryNoise noise;
  std::optional<GyroSettings> gyro{};  ///< nothing: odometry is open loop
};

/// Events since the start, for diagnostics, beside those of the parts.
struct DriveCounts {
  std::uint64_t clamped = 0;      ///< commands beyond a limit
  std::uint64_t ignored = 0;      ///< commands with components that a chair cannot obey
  std::uint64_t late_ticks = 0;   ///< later than longest_step
  std::uint64_t time_resets = 0;  ///< times that the clock ran backwards
};

/// Turns commands into voltages and keeps the odometry of what was really put out.
///
/// Each tick: who drives (Arbiter), how fast at most (SpeedCap), how soon (Limiter), by which voltages (Outlet).
/// Without anybody to obey the chair brakes to neutral, 0 V on both axes; at an emergency stop, and after the
/// clock ran backwards, it is neutral at once.
class Drive {
 public:
  enum class Tick { kFirst, kRepeated, kAdvanced, kReset };

  /// Puts out neutral. The converter must outlive this object.
  Drive(const DriveSettings& settings, Dac& dac);

  /// Takes a command of a publisher on an input at time t [s]; Arbiter::command says when it is refused (false).
  bool command(std::size_t input, const std::string& publisher, const Rates& rates, double t);

  /// Counts a command that also asks for what a chair cannot do, such as driving sideways.
  void countIgnored() { ++counts_.ignored; }

  /// Integrates the last output up to t [s], then puts out what follows from what was heard.
  Tick tick(double t);

  /// From now, time t [s], odometry goes on from that pose; what the chair does stays as it is.
  void place(const Pose2D& pose, const Eigen::Matrix3d& covariance, double t);

  /// Forgets every command and puts out neutral at time t [s].
  void stop(double t);

  /// Brakes, and obeys nobody, as long as this is on; then every input must be released anew.
  void cutOff(bool on) { cut_off_ = on; }

  /// Releases the emergency stop, and what locks hold of publishers that are gone, at time t [s], or says why not. Every
  /// input must be released anew.
  std::string resetEStop(double t);

  /// Other limits for those inputs that use this set, from the next tick on.
  void configure(std::size_t set, const Limits& limits);

  Arbiter& arbiter() { return arbiter_; }
  EStop& eStop() { return estop_; }
  SpeedCap& speedCap() { return cap_; }
  const Arbiter& arbiter() const { return arbiter_; }
  const EStop& eStop() const { return estop_; }
  const SpeedCap& speedCap() const { return cap_; }
  const Outlet& outlet() const { return outlet_; }
  const Output& output() const { return output_; }
  const Odometry& odometry() const { return reckoning_.odometry(); }
  Reckoning& reckoning() { return reckoning_; }
  const Reckoning& reckoning() const { return reckoning_; }
  const DriveCounts& counts() const { return counts_; }
  const DriveSettings& settings() const { return settings_; }
  bool isCutOff() const { return cut_off_; }
  double cap() const { return now_cap_; }  ///< as of the last tick [m/s]

 private:
  Tick advanceTo(double t);
  void move(double t, double dt);
  void put(const Rates& rates);

  DriveSettings settings_;
  Dac& dac_;
  Arbiter arbiter_;
  EStop estop_;
  SpeedCap cap_;
  Limiter limiter_;
  std::size_t set_ = 0;  ///< of limits in force
  Outlet outlet_;
  Reckoning reckoning_;
  DriveCounts counts_;
  Output output_{};
  bool cut_off_ = false;
  double now_cap_;
  std::optional<double> last_tick_;
};

}  // namespace kurumaisu
