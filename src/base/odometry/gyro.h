// SPDX-License-Identifier: BSD-3-Clause
// A gyro's yaw rate for odometry: integrated over intervals, its bias estimated while the chair stands.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/odometry/odometry.h"

namespace kurumaisu {

struct GyroSettings {
  double timeout;     ///< without a sample for so long there is no gyro [s]
  double variance;    ///< of a sample that comes without one [rad^2/s^2]
  double scale_sd;    ///< of its scale [1]
  double bias_walk;   ///< how the bias wanders [rad/s per root of s]
  double bias_limit;  ///< a gyro at rest that shows more is refused, or does not stand still [rad/s]
  double settle;      ///< the chair stands so long after neutral, if its rate agrees [s]
  double window;      ///< over which the bias is a mean [s]
  double still;  ///< at rest samples scatter less, and none is farther from the bias than 5 times it [rad/s]
};

/// Events since the start, for diagnostics.
struct GyroCounts {
  std::uint64_t samples = 0;    ///< received
  std::uint64_t refused = 0;    ///< of those, not plausible, out of order, or of another time than now
  std::uint64_t fallbacks = 0;  ///< times that odometry had to do without
  std::uint64_t biases = 0;     ///< estimates of the bias
};

/// All times [s] are of the clock that ticks give.
class Gyro {
 public:
  struct Bias {
    double rate;      ///< [rad/s]
    double variance;  ///< [rad^2/s^2]
    double t;         ///< when it was estimated
  };

  explicit Gyro(const GyroSettings& settings) : settings_(settings) {}

  /// Takes the yaw rate w [rad/s] of time t; variance 0: unknown. Says why not, and counts it, for what is no sample.
  std::string add(double w, double variance, double t, double now);

  /// Counts a sample without a yaw rate.
  void refuse();

  /// Says whether neutral was put out from a time on. Only then can the chair stand.
  void setNeutral(bool neutral, double from);

  /// The turn from one tick to the next, for adjoining intervals in order; nothing while the bias is unknown and
  /// where samples are missing. A sample that comes late counts in the next interval. 0 while the chair stands.
  std::optional<Turn> turn(double from, double to);

  /// Forgets all samples, not the bias: the clock was set.
  void restart();

  const std::optional<Bias>& bias() const { return bias_; }
  bool standing() const { return standing_; }
  bool inUse() const { return used_.has_value(); }
  const GyroSettings& settings() const { return settings_; }
  const GyroCounts& counts() const { return counts_; }

 private:
  struct Sample {
    double w;         // [rad/s]
    double t;         // [s]
    double integral;  // of all rates up to t [rad]
    double density;   // of its noise: variance times the time it stands for [rad^2/s]
  };
  struct Window {
    double start = 0;  // [s]
    int count = 0;
    double mean = 0;
    double squares = 0;  // sum of squared distances to the mean
  };

  double angleAt(double t) const { return last_->integral + last_->w * (t - last_->t); }
  void check(double w, double variance, double t, double now) const;
  void watch(double w, double t);
  void close(double t);
  void moved(double t);

  GyroSettings settings_;
  GyroCounts counts_;
  std::optional<Sample> last_;
  std::optional<double> used_;  // integral up to which turns have been given
  std::optional<double> neutral_since_;
  std::optional<Window> window_;
  std::optional<Bias> bias_;
  bool standing_ = false;
};

}  // namespace kurumaisu
