// SPDX-License-Identifier: BSD-3-Clause
#include "guard/guard.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "steady.h"

namespace kurumaisu::guard {
namespace {

constexpr double kSlack = 1e-9;  // [V]

bool isWithin(const Band& band, double volts) { return band.low <= volts && volts <= band.high; }

/// [V] of a step that counts: away from neutral, or all of it where it crosses neutral.
double away(double from, double to) {
  return from * to < 0 ? std::abs(to - from) : std::max(0.0, std::abs(to) - std::abs(from));
}

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

}  // namespace

void validate(const Limits& limits) {
  for (const Band& band : {limits.translation, limits.steering}) {
    require(band.low < 0 && band.high > 0, "a band must reach from below 0 V to above 0 V");
    require(band.step > 0, "step must be above 0 V");
    require(band.rate > 0, "rate must be above 0 V/s");
    require(limits.neutral < std::min(-band.low, band.high), "neutral must lie inside both bands");
  }
  require(limits.neutral >= 0 && limits.reference_tolerance >= 0, "a tolerance must not be negative");
  require(std::isfinite(limits.reference), "the reference must be finite");
  require(limits.age > 0 && limits.age <= limits.silence, "age must be above 0 s and at most silence");
  require(limits.silence < limits.arming, "silence must be shorter than arming");
}

Guard::Guard(const Limits& limits)
    : limits_(limits), translation_{limits.translation}, steering_{limits.steering} {
  validate(limits);
}

double Guard::Axis::spentAt(double now) const { return std::max(0.0, spent - band.rate * (now - at)); }

bool Guard::Axis::allows(double to, double now) const {
  return spentAt(now) + away(volts, to) <= band.step + kSlack;
}

void Guard::Axis::go(double to, double now) {
  spent = spentAt(now) + away(volts, to);
  at = now;
  volts = to;
}

void Guard::connect() { sequence_.reset(); }

void Guard::disconnect() {
  if (state_ == State::kArmed) trip(Reason::kClientGone);
  if (state_ == State::kHolding) state_ = reason_ == Reason::kNone ? State::kIdle : State::kTripped;
  sequence_.reset();
}

void Guard::loseDevice() {
  has_device_ = false;
  if (state_ != State::kIdle) trip(Reason::kDevice);
}

void Guard::watch(bool is_watched) {
  is_watched_ = is_watched;
  if (!is_watched) trip(Reason::kUnwatched);
}

void Guard::receive(const Request& request, double now) {
  advance(now);
  const Reason problem = judge(request, now);
  if (problem == Reason::kNone) {
    accept(request, now);
  } else {
    trip(problem);
  }
}

void Guard::advance(double now) {
  if (now > deadline().value_or(now)) trip(Reason::kSilent);
}

std::optional<double> Guard::deadline() const {
  const bool is_waiting = state_ == State::kHolding || state_ == State::kArmed;
  return is_waiting ? std::optional(last_made_ + limits_.silence) : std::nullopt;
}

dac::Volts Guard::output() const {
  if (state_ != State::kArmed) return {0, 0, limits_.reference};
  return {translation_.volts, steering_.volts, limits_.reference};
}

Reason Guard::judge(const Request& request, double now) const {
  if (request.version != kVersion) return Reason::kVersion;
  if (sequence_ && request.sequence <= *sequence_) return Reason::kSequence;
  if (const Reason problem = judgeTime(request, now); problem != Reason::kNone) return problem;
  if (request.kind == static_cast<std::uint16_t>(Kind::kStop)) return Reason::kStopped;
  if (request.kind != static_cast<std::uint16_t>(Kind::kPut)) return Reason::kGarbage;
  if (!has_device_) return Reason::kDevice;
  if (!is_watched_) return Reason::kUnwatched;
  return judgeVolts(request, now);
}

Reason Guard::judgeTime(const Request& request, double now) const {
  const double made = seconds(request.time);
  if (made > now) return Reason::kFuture;
  const bool runs_back = sequence_ && made < last_made_;
  return now - made > limits_.age || runs_back ? Reason::kOld : Reason::kNone;
}

Reason Guard::judgeVolts(const Request& request, double now) const {
  if (!std::isfinite(request.translation) || !std::isfinite(request.steering) ||
      !std::isfinite(request.reference)) {
    return Reason::kNotFinite;
  }
  if (!isWithin(limits_.translation, request.translation) || !isWithin(limits_.steering, request.steering)) {
    return Reason::kBand;
  }
  if (std::abs(request.reference - limits_.reference) > limits_.reference_tolerance)
    return Reason::kReference;
  if (state_ != State::kArmed) return isNeutral(request) ? Reason::kNone : Reason::kNotNeutral;
  const bool is_allowed =
      translation_.allows(request.translation, now) && steering_.allows(request.steering, now);
  return is_allowed ? Reason::kNone : Reason::kStep;
}

void Guard::accept(const Request& request, double now) {
  sequence_ = request.sequence;
  last_made_ = seconds(request.time);
  if (state_ == State::kIdle || state_ == State::kTripped) {
    state_ = State::kHolding;
    hold_since_ = now;
  }
  if (state_ == State::kHolding && now - hold_since_ >= limits_.arming) {
    state_ = State::kArmed;
    reason_ = Reason::kNone;
  }
  translation_.go(request.translation, now);
  steering_.go(request.steering, now);
}

void Guard::trip(Reason reason) {
  if (state_ == State::kTripped) return;  // the first reason is the one to know
  state_ = State::kTripped;
  reason_ = reason;
  ++trips_;
}

bool Guard::isNeutral(const Request& request) const {
  return std::abs(request.translation) <= limits_.neutral && std::abs(request.steering) <= limits_.neutral;
}

}  // namespace kurumaisu::guard
