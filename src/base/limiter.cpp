// SPDX-License-Identifier: BSD-3-Clause
#include "base/limiter.h"

#include <algorithm>
#include <cmath>

namespace kurumaisu {
namespace {

constexpr double kRounding = 1e-9;

double towardsZero(double rate, double step) {
  return std::copysign(std::max(0.0, std::abs(rate) - step), rate);
}

}  // namespace

Rates shaped(const Limits& limits, const Rates& command, double cap) {
  const double v_most = std::min(command.v < 0 ? limits.v_reverse : limits.v_forward, cap);
  const double w_most = limits.w * std::min(1.0, cap / limits.v_forward);
  Rates result{std::clamp(command.v, -v_most, v_most), std::clamp(command.w, -w_most, w_most)};
  if (limits.keep_curvature && !command.zero()) {
    // Of a rate of 0 nothing is left or all: 0 / 0 must not come up.
    const double v_share = command.v == 0 ? 1 : result.v / command.v;
    const double w_share = command.w == 0 ? 1 : result.w / command.w;
    const double share = std::min(v_share, w_share);
    if (share < 1) result = {share * command.v, share * command.w};
  }
  const double lateral = std::abs(result.v * result.w);
  if (lateral <= limits.lateral_acceleration) return result;
  const double share = limits.lateral_acceleration / lateral;
  if (!limits.keep_curvature) return {share * result.v, result.w};  // the turn is what the driver wants
  return {std::sqrt(share) * result.v, std::sqrt(share) * result.w};
}

Limiter::Limiter(const Limits& limits) : limits_(limits), v_(limits.v_ramp), w_(limits.w_ramp) {}

void Limiter::configure(const Limits& limits) {
  limits_ = limits;
  v_.configure(limits.v_ramp);
  w_.configure(limits.w_ramp);
}

Rates Limiter::advance(const Rates& command, double cap, double dt) {
  const Rates target = shaped(limits_, command, cap);
  // Neither rate leaves the interval between reach() of now and its target, so the product of both reaches
  // bounds |v w| for good. One axis at a time takes what the other leaves. After a limit was lowered the
  // product may be beyond it: then both go to their targets, which keep it.
  const double most = limits_.lateral_acceleration;
  const bool kept = v_.reach() * w_.reach() <= most * (1 + kRounding);
  const double v_most = kept ? most / w_.reach() : Limiter::kNoCap;
  v_.advance(std::clamp(target.v, -v_most, v_most), dt);
  const double w_most = kept ? most / v_.reach() : Limiter::kNoCap;
  w_.advance(std::clamp(target.w, -w_most, w_most), dt);
  return rates();
}

Rates Limiter::brake(double dt) {
  if (!(dt > 0)) return rates();
  const double v_step = limits_.v_ramp.deceleration * dt;
  const double w_step = limits_.w_ramp.deceleration * dt;
  const auto [v, w] = rates();
  if (limits_.keep_curvature) {
    const double steps = std::max(std::abs(v) / v_step, std::abs(w) / w_step);
    const double share = steps > 1 ? 1 - 1 / steps : 0;
    v_.put(share * v);
    w_.put(share * w);
  } else {
    v_.put(towardsZero(v, v_step));
    w_.put(towardsZero(w, w_step));
  }
  return rates();
}

void Limiter::reset() {
  v_.put(0);
  w_.put(0);
}

}  // namespace kurumaisu
