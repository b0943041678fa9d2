// SPDX-License-Identifier: BSD-3-Clause
// How an output follows its input where each sample needs the one before.
#pragma once

namespace kurumaisu {

/// Output that runs after its target no faster than a slope allows, exact for targets held over a step.
class RateLimiter {
 public:
  /// slowness: time [s] that a change by 1 takes; 0: none.
  RateLimiter(double slowness, double level) : slowness_(slowness), level_(level) {}

  /// Mean of the output over a step of dt [s] with this target.
  double step(double target, double dt);

  /// Output at the end of the last step.
  double level() const { return level_; }

 private:
  double slowness_;
  double level_;
};

/// First-order lag, exact for targets held over a step.
class Lag {
 public:
  /// Time constant tau [s], steps of dt [s].
  Lag(double tau, double dt, double level);

  /// Mean of the output over a step with this target.
  double step(double target) {
    const double out = target + (level_ - target) * mean_;
    level_ = (1 - decay_) * target + decay_ * level_;
    return out;
  }

  double level() const { return level_; }

 private:
  double decay_;  ///< share of a difference that is left after a step
  double mean_;   ///< share of it that there is in the step on the mean
  double level_;
};

/// Output that its input drags along by play: it stays where it is until the input is half the play away.
class Play {
 public:
  Play(double half, double level) : half_(half), level_(level) {}
  double step(double input);
  double level() const { return level_; }

 private:
  double half_;
  double level_;
};

}  // namespace kurumaisu
