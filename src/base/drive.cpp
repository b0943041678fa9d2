// SPDX-License-Identifier: BSD-3-Clause
#include "base/drive.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace kurumaisu {

std::optional<Band> ambiguousBand(const AxisLaw& law) {
  // A branch reaches from its intercept to infinity, on the side that its slope and its sign of the rate
  // give.
  const bool rising = law.positive.slope > 0;
  const Band band{rising ? law.positive.intercept : law.negative.intercept,
                  rising ? law.negative.intercept : law.positive.intercept};
  return band.low < band.high ? std::optional(band) : std::nullopt;
}

Drive::Drive(const DriveSettings& settings, Dac& dac)
    : settings_(settings),
      dac_(dac),
      translation_band_(ambiguousBand(settings.law.translation)),
      steering_band_(ambiguousBand(settings.law.steering)),
      reckoning_(settings.noise, settings.gyro) {
  put(0, 0);
}

bool Drive::command(double v, double w, double t) {
  ++counts_.commands;
  if (!std::isfinite(v) || !std::isfinite(w)) {
    ++counts_.refused;
    return false;
  }
  const Limits& limits = settings_.limits;
  const Command clamped{std::clamp(v, -limits.v_reverse, limits.v_forward),
                        std::clamp(w, -limits.w, limits.w), t};
  if (clamped.v != v || clamped.w != w) ++counts_.clamped;
  command_ = clamped;
  return true;
}

Drive::Tick Drive::tick(double t) {
  const Tick result = advanceTo(t);
  if (command_ && t - command_->t > settings_.command_timeout) {
    if (command_->v != 0 || command_->w != 0) ++counts_.timeouts;
    command_.reset();
  }
  put(command_ ? command_->v : 0, command_ ? command_->w : 0);
  return result;
}

void Drive::stop(double t) {
  command_.reset();
  advanceTo(t);
  put(0, 0);
}

Drive::Tick Drive::advanceTo(double t) {
  const std::optional<double> last = std::exchange(last_tick_, t);
  if (!last) return Tick::kFirst;
  if (t < *last) {
    ++counts_.time_resets;
    command_.reset();
    reckoning_.restart();
    return Tick::kReset;
  }
  if (t == *last) return Tick::kRepeated;
  reckoning_.advance(output_.v, output_.w, *last, t);
  return Tick::kAdvanced;
}

void Drive::place(const Pose2D& pose, const Eigen::Matrix3d& covariance, double t) {
  advanceTo(t);  // or the way since the last tick would count as driven from there
  reckoning_.place(pose, covariance);
}

void Drive::put(double v, double w) {
  output_ = {settings_.law.translation.volts(v), settings_.law.steering.volts(w), settings_.reference_voltage,
             v, w};
  ++counts_.samples;
  const auto isIn = [](const std::optional<Band>& band, double volts) {
    return band && band->contains(volts);
  };
  if (isIn(translation_band_, output_.translation) || isIn(steering_band_, output_.steering)) {
    ++counts_.ambiguous;
  }
  dac_.put(output_);
}

}  // namespace kurumaisu
