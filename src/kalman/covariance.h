// SPDX-License-Identifier: BSD-3-Clause
// What the whitening filter knows of its state from increment to increment, and what that does to any column.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>

#include "kalman/ou_step.h"
#include "kalman/whiten.h"
#include "model/wide.h"

namespace kurumaisu {

/// Partial derivatives of one body increment by its two end poses, by the integrated rate errors and by their lateness,
/// and by such errors that act on this increment alone.
struct Jacobians {
  Eigen::Matrix3d from, to, motion, late, rolling;
};

/// What a step needs of the processes.
template <int kColours>
struct Processes {
  explicit Processes(const MotionNoise& noise)
      : colours{noise.fast, noise.slow}, lasting_tau(noise.lasting_tau) {
    for (int c = 0; c < kColours; ++c) {
      for (int i = 0; i < 3; ++i) variance[3 * c + i] = colours[c].sd[i] * colours[c].sd[i];
    }
  }

  /// Works them out for a time step, unless it is the last one again but for its rounding: many increments are alike.
  void advance(double next) {
    if (std::abs(next - dt) <= kRounding * next) return;
    dt = next;
    for (int c = 0; c < kColours; ++c) steps[c] = ouStep(dt, colours[c].tau);
    lasting_keep = std::exp(-dt / lasting_tau);
  }

  static constexpr double kRounding = 1e-12;
  std::array<Colour, 2> colours;
  std::array<double, std::size_t{3} * kColours> variance;
  double lasting_tau;
  double dt = 0.0;
  double lasting_keep = 0.0;  // share of a lasting error that is there a step later
  std::array<OuStep, kColours> steps{};
};

/// The filter's covariance, step by step. Rows are a little longer than needed, for the machine takes some at once.
/// Its state: white errors of the pose, errors of the rates, and errors of the pose that last, if any.
template <int kColours, bool kLasting>
class Covariance {
 public:
  static constexpr int kRates = 3, kLong = 3 + 3 * kColours, kSize = kLong + (kLasting ? 3 : 0);

  explicit Covariance(const MotionNoise& noise) : processes_(noise) {
    const double sd[] = {noise.position_sd, noise.position_sd, noise.heading_sd};
    for (int i = 0; i < 3; ++i) {
      white_[i] = (1 - noise.lasting) * sd[i] * sd[i];
      long_[i] = noise.lasting * sd[i] * sd[i];
      cov_[i][i] = white_[i];
      if constexpr (kLasting) cov_[kLong + i][kLong + i] = long_[i];
    }
    for (int i = kRates; i < kLong; ++i) cov_[i][i] = processes_.variance[i - kRates];
  }

  /// Goes on by an increment of dt [s], and tells what that does to any column, and its log variances. Returns false
  /// where its covariance is singular.
  KURUMAISU_INLINE bool advance(const Jacobians& j, double dt, Whitener::Step<kSize>& step, double* logs) {
    processes_.advance(dt);
    for (int i = 0; i < 3; ++i) {
      fresh_[i] = kLasting ? (1 - processes_.lasting_keep * processes_.lasting_keep) * long_[i] : 0.0;
    }
    see(j, step);
    double root[3][3];
    if (!cholesky(step, j, root)) return false;
    for (int r = 0; r < 3; ++r) logs[r] = 2.0 * std::log(root[r][r]);
    const double l00 = 1.0 / root[0][0], l11 = 1.0 / root[1][1], l22 = 1.0 / root[2][2];
    const double l10 = -root[1][0] * l00 * l11;
    const double l21 = -root[2][1] * l11 * l22;
    const double l20 = -(root[2][0] * l00 + root[2][1] * l10) * l22;
    step.lower = {l00, l10, l11, l20, l21, l22};
    cross(j, step);
    for (int i = 0; i < kSize; ++i) {  // gained: the root of what the increment tells of the state
      const double a = cross_[0][i], b = cross_[1][i], c = cross_[2][i];
      gained_[0][i] = l00 * a;
      gained_[1][i] = l10 * a + l11 * b;
      gained_[2][i] = l20 * a + l21 * b + l22 * c;
      step.gain[i] = {l00 * gained_[0][i] + l10 * gained_[1][i] + l20 * gained_[2][i],
                      l11 * gained_[1][i] + l21 * gained_[2][i], l22 * gained_[2][i]};
    }
    update(step);
    return true;
  }

 private:
  static constexpr int kRow = (kSize + 3) / 4 * 4;

  /// State to increment, and its covariance with the increment.
  KURUMAISU_INLINE void see(const Jacobians& j, Whitener::Step<kSize>& step) {
    for (int r = 0; r < 3; ++r) {
      for (int i = 0; i < 3; ++i) {
        step.seen[r][i] = j.from(r, i);
        for (int c = 0; c < kColours; ++c) {
          const OuStep& ou = processes_.steps[c];
          step.seen[r][kRates + 3 * c + i] = ou.reach * j.motion(r, i) + ou.late * j.late(r, i);
        }
        if constexpr (kLasting) step.seen[r][kLong + i] = j.from(r, i) + processes_.lasting_keep * j.to(r, i);
      }
      for (int i = 0; i < kRow; ++i) seen_[r][i] = 0.0;
      for (int k = 0; k < kSize; ++k) {
        const double by = step.seen[r][k];
        for (int i = 0; i < kRow; ++i) seen_[r][i] += by * cov_[k][i];
      }
    }
  }

  /// The root of the increment's covariance.
  KURUMAISU_INLINE bool cholesky(const Whitener::Step<kSize>& step, const Jacobians& j,
                                 double (&root)[3][3]) const {
    double spread[3] = {}, late[3] = {}, both[3] = {};  // of the rates' own noise during the increment
    double whole[3] = {};                               // spread of noise that begins with it
    for (int c = 0; c < kColours; ++c) {
      const OuStep& ou = processes_.steps[c];
      for (int i = 0; i < 3; ++i) {
        const double variance = processes_.variance[3 * c + i];
        spread[i] += ou.var_integral * variance;
        late[i] += ou.var_late * variance;
        both[i] += ou.cov_both * variance;
        whole[i] += (ou.var_integral + ou.reach * ou.reach) * variance;
      }
    }
    for (int r = 0; r < 3; ++r) {
      for (int s = 0; s <= r; ++s) {
        double sum = 0.0;
        for (int i = 0; i < kSize; ++i) sum += step.seen[r][i] * seen_[s][i];
        for (int i = 0; i < 3; ++i) {
          sum += (white_[i] + fresh_[i]) * j.to(r, i) * j.to(s, i) +
                 spread[i] * j.motion(r, i) * j.motion(s, i) + late[i] * j.late(r, i) * j.late(s, i) +
                 both[i] * (j.motion(r, i) * j.late(s, i) + j.late(r, i) * j.motion(s, i)) +
                 whole[i] * j.rolling(r, i) * j.rolling(s, i);
        }
        for (int k = 0; k < s; ++k) sum -= root[r][k] * root[s][k];
        if (r == s && sum <= 0) return false;
        root[r][s] = r == s ? std::sqrt(sum) : sum / root[s][s];
      }
    }
    return true;
  }

  /// Covariance of the next state with this increment: e anew, u decayed, and the noise that both have in common.
  KURUMAISU_INLINE void cross(const Jacobians& j, Whitener::Step<kSize>& step) {
    for (int i = 0; i < 3; ++i) step.keep[i] = 0.0;
    for (int r = 0; r < 3; ++r) {
      for (int i = 0; i < 3; ++i) {
        cross_[r][i] = white_[i] * j.to(r, i);
        if constexpr (kLasting) {
          step.keep[kLong + i] = processes_.lasting_keep;
          cross_[r][kLong + i] = processes_.lasting_keep * seen_[r][kLong + i] + fresh_[i] * j.to(r, i);
        }
      }
      for (int c = 0; c < kColours; ++c) {
        const OuStep& ou = processes_.steps[c];
        for (int axis = 0; axis < 3; ++axis) {
          const int i = kRates + 3 * c + axis;
          step.keep[i] = ou.decay;
          cross_[r][i] =
              ou.decay * seen_[r][i] +
              processes_.variance[i - kRates] * (ou.cov * j.motion(r, axis) + ou.cov_late * j.late(r, axis));
        }
      }
    }
  }

  /// Covariance of the next state, given this increment.
  KURUMAISU_INLINE void update(const Whitener::Step<kSize>& step) {
    double keep[kRow] = {};
    for (int i = 0; i < kSize; ++i) keep[i] = step.keep[i];
    for (int k = 0; k < kSize; ++k) {
      const double a = gained_[0][k], b = gained_[1][k], c = gained_[2][k], own = keep[k];
      for (int i = 0; i < kRow; ++i) {
        cov_[k][i] = own * keep[i] * cov_[k][i] - (a * gained_[0][i] + b * gained_[1][i] + c * gained_[2][i]);
      }
    }
    for (int i = 0; i < 3; ++i) {
      cov_[i][i] += white_[i];
      if constexpr (kLasting) cov_[kLong + i][kLong + i] += fresh_[i];
    }
    for (int i = kRates; i < kLong; ++i) {
      cov_[i][i] += processes_.steps[(i - kRates) / 3].var_u * processes_.variance[i - kRates];
    }
  }

  alignas(64) double cov_[kSize][kRow] = {};
  alignas(64) double seen_[3][kRow] = {};
  alignas(64) double cross_[3][kRow] = {};
  alignas(64) double gained_[3][kRow] = {};
  double white_[3], long_[3];  // variances of the reference's errors
  double fresh_[3] = {};       // of what is new in those that last
  Processes<kColours> processes_;
};

}  // namespace kurumaisu
