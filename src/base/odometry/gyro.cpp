// SPDX-License-Identifier: BSD-3-Clause
#include "base/odometry/gyro.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "plausible/quantity.h"

namespace kurumaisu {
namespace {

constexpr int kFewest = 10;   // samples of a window that say something of the bias
constexpr double kFar = 5.0;  // standard deviations at rest that no sample is away from the bias

}  // namespace

/// Throws std::invalid_argument for what is no sample.
void Gyro::check(double w, double variance, double t, double now) const {
  require(plausible::kYawRate, "yaw rate", w);
  require(plausible::kVariance, "variance of the yaw rate", variance);
  std::ostringstream text;
  if (!(std::abs(now - t) <= settings_.timeout)) {
    text << "stamp: must be at most " << settings_.timeout << " s away from now: " << now - t << " s old";
    throw std::invalid_argument(text.str());
  }
  if (last_ && t <= last_->t) {
    text << "stamp: must be later than that of the last sample: " << last_->t - t << " s before it";
    throw std::invalid_argument(text.str());
  }
}

void Gyro::refuse() {
  ++counts_.samples;
  ++counts_.refused;
}

std::string Gyro::add(double w, double variance, double t, double now) {
  try {
    check(w, variance, t, now);
  } catch (const std::invalid_argument& error) {
    refuse();
    return error.what();
  }
  ++counts_.samples;
  if (last_ && t - last_->t > settings_.timeout) restart();
  const double dt = last_ ? t - last_->t : 0;
  const double before = last_ ? last_->integral + 0.5 * (last_->w + w) * dt : 0;
  last_ = Sample{w, t, before, (variance > 0 ? variance : settings_.variance) * dt};
  watch(w, t);
  return "";
}

void Gyro::setNeutral(bool neutral, double from) {
  if (neutral && !neutral_since_) neutral_since_ = from;
  if (neutral) return;
  neutral_since_.reset();
  window_.reset();
  standing_ = false;
}

std::optional<Turn> Gyro::turn(double from, double to) {
  if (!last_ || !bias_ || to - last_->t > settings_.timeout) {
    if (used_) ++counts_.fallbacks;
    used_.reset();
    return std::nullopt;
  }
  const double begin = used_ ? *used_ : angleAt(from);
  used_ = angleAt(to);
  if (standing_) return Turn{0, 0};
  return Turn{*used_ - begin - bias_->rate * (to - from), last_->density * (to - from)};
}

void Gyro::restart() {
  if (used_) ++counts_.fallbacks;
  last_.reset();
  used_.reset();
  window_.reset();
  neutral_since_.reset();
  standing_ = false;
}

/// Somebody pushes the chair, or it has not come to rest yet.
void Gyro::moved(double t) {
  standing_ = false;
  window_.reset();
  neutral_since_ = t;
}

void Gyro::watch(double w, double t) {
  if (!neutral_since_ || t < *neutral_since_ + settings_.settle) return;
  const double away = bias_ ? std::abs(w - bias_->rate) / settings_.still : 0;
  if (away > kFar) return moved(t);
  if (!window_) window_ = Window{t};
  Window& window = *window_;
  ++window.count;
  const double distance = w - window.mean;
  window.mean += distance / window.count;
  window.squares += distance * (w - window.mean);
  if (t - window.start >= settings_.window && window.count >= kFewest) close(t);
}

void Gyro::close(double t) {
  const Window window = *window_;
  window_.reset();
  const double variance = window.squares / (window.count - 1);
  if (std::abs(window.mean) > settings_.bias_limit || std::sqrt(variance) > settings_.still) {
    return moved(t);
  }
  const double measured = variance / window.count;
  if (!bias_) {
    bias_ = Bias{window.mean, measured, t};
  } else {
    const double wandered = settings_.bias_walk * settings_.bias_walk * (t - bias_->t);
    const double before = bias_->variance + std::abs(wandered);
    const double sum = before + measured;
    const double gain = sum > 0 ? before / sum : 1;
    bias_ = Bias{bias_->rate + gain * (window.mean - bias_->rate), (1 - gain) * before, t};
  }
  ++counts_.biases;
  standing_ = true;
}

}  // namespace kurumaisu
