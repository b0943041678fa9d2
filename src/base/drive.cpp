// SPDX-License-Identifier: BSD-3-Clause
#include "base/drive.h"

#include <algorithm>
#include <utility>

namespace kurumaisu {

Drive::Drive(const DriveSettings& settings, Dac& dac)
    : settings_(settings),
      dac_(dac),
      arbiter_(settings.arbiter),
      estop_(settings.estop_timeout),
      cap_(settings.cap),
      limiter_(settings.limits.at(0)),
      outlet_(settings.outlet),
      reckoning_(settings.noise, settings.gyro),
      now_cap_(settings.cap.fallback) {
  put({});
}

bool Drive::command(std::size_t input, const std::string& publisher, const Rates& rates, double t) {
  if (!arbiter_.command(input, publisher, rates, t)) return false;
  const Limits& limits = settings_.limits[settings_.arbiter.inputs[input].limits];
  const Rates allowed = shaped(limits, rates, Limiter::kNoCap);
  if (allowed.v != rates.v || allowed.w != rates.w) ++counts_.clamped;
  return true;
}

Drive::Tick Drive::tick(double t) {
  const double dt = last_tick_ ? t - *last_tick_ : 0;
  const Tick result = advanceTo(t);
  if (dt > settings_.longest_step) ++counts_.late_ticks;
  move(t, std::clamp(dt, 0.0, settings_.longest_step));
  return result;
}

void Drive::move(double t, double dt) {
  estop_.tick(t);
  now_cap_ = cap_.at(t);
  if (estop_.latched() || cut_off_)
    arbiter_.disarm();  // whoever commands must let go before it is obeyed again
  const Choice choice = arbiter_.choose(t);
  if (choice.input && settings_.arbiter.inputs[*choice.input].limits != set_) {
    set_ = settings_.arbiter.inputs[*choice.input].limits;
    limiter_.configure(settings_.limits[set_]);
  }
  if (estop_.stopped()) {
    limiter_.reset();
  } else if (choice.reason == Reason::kDriving && !cut_off_) {
    limiter_.advance(choice.command, now_cap_, dt);
  } else {
    limiter_.brake(dt);
  }
  put(limiter_.rates());
}

void Drive::stop(double t) {
  arbiter_.reset();
  limiter_.reset();
  advanceTo(t);
  put({});
}

std::string Drive::resetEStop(double t) {
  estop_.tick(t);
  std::string refusal = estop_.reset(arbiter_.moving(t));
  if (refusal.empty()) arbiter_.forgetGone();
  return refusal;
}

void Drive::configure(std::size_t set, const Limits& limits) {
  settings_.limits.at(set) = limits;
  if (set == set_) limiter_.configure(limits);
}

Drive::Tick Drive::advanceTo(double t) {
  const std::optional<double> last = std::exchange(last_tick_, t);
  if (!last) return Tick::kFirst;
  if (t < *last) {
    ++counts_.time_resets;
    limiter_.reset();
    reckoning_.restart();
    return Tick::kReset;  // the parts see it for themselves
  }
  if (t == *last) return Tick::kRepeated;
  const double held = std::min(t, *last + dac_.patience());  // a guard does not wait for a tick that is late
  reckoning_.advance(output_.v, output_.w, *last, held);
  if (held < t) reckoning_.advance(0, 0, held, t);
  return Tick::kAdvanced;
}

void Drive::place(const Pose2D& pose, const Eigen::Matrix3d& covariance, double t) {
  advanceTo(t);  // or the way since the last tick would count as driven from there
  reckoning_.place(pose, covariance);
}

void Drive::put(const Rates& rates) { output_ = dac_.put(outlet_.at(rates.v, rates.w)); }

}  // namespace kurumaisu
