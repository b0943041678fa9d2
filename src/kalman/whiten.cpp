// SPDX-License-Identifier: BSD-3-Clause
#include "kalman/whiten.h"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <stdexcept>

namespace kurumaisu {
namespace {

using Matrix3 = Eigen::Matrix3d;
// Of e_k (pose error, map frame) and u_k (rate error, one of each colour).
template <int kColours>
using State = Eigen::Matrix<double, 3 + 3 * kColours, 3 + 3 * kColours>;
template <int kColours>
using Increments = Eigen::Matrix<double, 3, 3 + 3 * kColours>;  // e_k, u_k to one increment

/// Discrete Ornstein-Uhlenbeck process of unit variance over dt, with its integral over the interval.
struct OuStep {
  double decay;         ///< u' = decay u + noise
  double reach;         ///< integral = reach u + noise [s]
  double var_u;         ///< of the noise in u'
  double var_integral;  ///< of the noise in the integral [s^2]
  double cov;           ///< between the two [s]
};

OuStep ouStep(double dt, double tau) {
  const double x = dt / tau;
  const double decay = std::exp(-x);
  const double lost = -std::expm1(-x);
  // For small x the closed form cancels to nothing; its series does not.
  const double spread =
      x < 1e-2 ? 2.0 / 3.0 * x * x * x - 0.5 * x * x * x * x : 2.0 * x - 4.0 * lost - std::expm1(-2.0 * x);
  return {decay, tau * lost, -std::expm1(-2.0 * x), tau * tau * spread, tau * lost * lost};
}

/// Partial derivatives of one body increment by its two end poses and by the integrated rate errors.
struct Jacobians {
  Matrix3 from, to, motion;
};

Jacobians jacobians(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double c = std::cos(a.z());
  const double s = std::sin(a.z());
  const Eigen::Vector3d world = b - a;
  const double dx = c * world.x() + s * world.y();
  const double dy = -s * world.x() + c * world.y();
  const double mid = 0.5 * world.z();
  Jacobians j;
  j.to << c, s, 0, -s, c, 0, 0, 0, 1;
  j.from = -j.to;
  j.from(0, 2) = dy;
  j.from(1, 2) = -dx;
  // A rate error acts over the whole interval: along the mean heading, and a yaw error swings the rest of the way.
  j.motion << std::cos(mid), -std::sin(mid), -0.5 * dy, std::sin(mid), std::cos(mid), 0.5 * dx, 0, 0, 1;
  return j;
}

void check(const Eigen::MatrixXd& poses, const Eigen::VectorXd& times, const Eigen::VectorXd& activity,
           const MotionNoise& noise) {
  const Eigen::Index n = poses.rows() - 1;
  if (n < 1 || poses.cols() != 3) throw std::invalid_argument("poses must have shape (n + 1, 3), n > 0");
  if (times.size() != n + 1) throw std::invalid_argument("times and poses must have the same length");
  if (!((times.tail(n) - times.head(n)).array() > 0).all()) {
    throw std::invalid_argument("times must increase");
  }
  if (activity.size() != n || !(activity.array() >= 0).all()) {
    throw std::invalid_argument("activity must have one factor per increment, none negative");
  }
  if (!(noise.position_sd > 0 && noise.heading_sd > 0 && noise.fast.tau > 0 && noise.slow.tau > 0) ||
      !(noise.fast.sd.array() > 0).all() || !(noise.slow.sd.array() >= 0).all()) {
    throw std::invalid_argument("every noise parameter must be positive");
  }
}

template <int kColours>
std::vector<Whitener::Step<3 + 3 * kColours>> filter(const Eigen::MatrixXd& poses,
                                                     const Eigen::VectorXd& times,
                                                     const Eigen::VectorXd& activity,
                                                     const MotionNoise& noise,
                                                     Eigen::MatrixX3d& log_determinants) {
  constexpr int kSize = 3 + 3 * kColours;
  const Eigen::Index n = poses.rows() - 1;
  const Matrix3 pose_cov = Eigen::Vector3d(noise.position_sd, noise.position_sd, noise.heading_sd)
                               .array()
                               .square()
                               .matrix()
                               .asDiagonal();
  const std::array<Colour, 2> colours{noise.fast, noise.slow};
  std::array<Matrix3, kColours> rate_cov;
  State<kColours> cov = State<kColours>::Zero();
  cov.template topLeftCorner<3, 3>() = pose_cov;
  for (int c = 0; c < kColours; ++c) {
    rate_cov[c] = colours[c].sd.array().square().matrix().asDiagonal();
    cov.template block<3, 3>(3 + 3 * c, 3 + 3 * c) = rate_cov[c];
  }

  std::vector<Whitener::Step<kSize>> steps(static_cast<std::size_t>(n));
  double dt = 0.0;  // of the processes as worked out last: many increments are alike
  std::array<OuStep, kColours> processes{};
  for (Eigen::Index k = 0; k < n; ++k) {
    Jacobians j = jacobians(poses.row(k).transpose(), poses.row(k + 1).transpose());
    j.motion *= activity[k];
    if (times[k + 1] - times[k] != dt) {
      dt = times[k + 1] - times[k];
      for (int c = 0; c < kColours; ++c) processes[c] = ouStep(dt, colours[c].tau);
    }

    // Next state (e_{k+1}, u_{k+1}): a new pose error, and rate errors that decay; h: the state to this increment.
    Increments<kColours> h;
    h.template leftCols<3>() = j.from;
    State<kColours> q = State<kColours>::Zero();
    q.template topLeftCorner<3, 3>() = pose_cov;
    Eigen::Matrix<double, kSize, 1> keep = Eigen::Matrix<double, kSize, 1>::Zero();
    Eigen::Matrix<double, kSize, 3> shared;  // noise that the next state and this increment have in common
    shared.template topRows<3>() = pose_cov * j.to.transpose();
    Matrix3 fresh = j.to * pose_cov * j.to.transpose();
    for (int c = 0; c < kColours; ++c) {
      const OuStep& ou = processes[c];
      h.template middleCols<3>(3 + 3 * c) = ou.reach * j.motion;
      q.template block<3, 3>(3 + 3 * c, 3 + 3 * c) = ou.var_u * rate_cov[c];
      keep.template segment<3>(3 + 3 * c).setConstant(ou.decay);
      shared.template middleRows<3>(3 + 3 * c) = ou.cov * rate_cov[c] * j.motion.transpose();
      fresh += j.motion * (ou.var_integral * rate_cov[c]) * j.motion.transpose();
    }

    const Eigen::Matrix<double, kSize, 3> seen = cov * h.transpose();
    const Eigen::LLT<Matrix3> llt(h * seen + fresh);
    if (llt.info() != Eigen::Success) throw std::invalid_argument("the increments' covariance is singular");
    log_determinants.row(k) = 2.0 * llt.matrixLLT().diagonal().array().log().transpose();
    const Eigen::Matrix<double, kSize, 3> cross = keep.asDiagonal() * seen + shared;
    const Eigen::Matrix<double, kSize, 3> gain = llt.solve(cross.transpose()).transpose();
    const Matrix3 lower = llt.matrixL().solve(Matrix3::Identity());
    cov = (keep.asDiagonal() * cov * keep.asDiagonal()).eval() + q - gain * cross.transpose();
    cov = 0.5 * (cov + cov.transpose()).eval();

    Whitener::Step<kSize>& step = steps[static_cast<std::size_t>(k)];
    for (int i = 0; i < kSize; ++i) {
      for (int r = 0; r < 3; ++r) {
        step.seen[r][i] = h(r, i);
        step.gain[i][r] = gain(i, r);
      }
      step.keep[i] = keep[i];
    }
    step.lower = {lower(0, 0), lower(1, 0), lower(1, 1), lower(2, 0), lower(2, 1), lower(2, 2)};
  }
  return steps;
}

constexpr Eigen::Index kLargest = 9;  // numbers in a state
constexpr Eigen::Index kLane = 8;     // columns that go through a step side by side

/// Filters some columns by one increment: `in` and `out` are rows of so many numbers, three of them; mean: of the state.
template <int kSize, int kColumns>
void filterLane(const Whitener::Step<kSize>& step, const double* in, Eigen::Index in_stride, double* out,
                Eigen::Index out_stride, double* mean) {
  using Lane = Eigen::Array<double, 1, kColumns>;
  std::array<Lane, kSize> state;
  for (int i = 0; i < kSize; ++i) state[i] = Eigen::Map<const Lane>(mean + std::ptrdiff_t{i} * kColumns);
  std::array<Lane, 3> innovation;
  for (int r = 0; r < 3; ++r) {
    innovation[r] = Eigen::Map<const Lane>(in + r * in_stride);
    for (int i = 0; i < kSize; ++i) innovation[r] -= step.seen[r][i] * state[i];
  }
  const auto& [l00, l10, l11, l20, l21, l22] = step.lower;
  Eigen::Map<Lane>{out} = l00 * innovation[0];
  Eigen::Map<Lane>{out + out_stride} = l10 * innovation[0] + l11 * innovation[1];
  Eigen::Map<Lane>{out + std::ptrdiff_t{2}* out_stride} =
      l20 * innovation[0] + l21 * innovation[1] + l22 * innovation[2];
  for (int i = 0; i < kSize; ++i) {
    const auto& gain = step.gain[i];
    Eigen::Map<Lane>{mean + std::ptrdiff_t{i}* kColumns} =
        step.keep[i] * state[i] + gain[0] * innovation[0] + gain[1] * innovation[1] + gain[2] * innovation[2];
  }
}

/// Filters m columns by one increment.
template <int kSize>
void filterStep(const Whitener::Step<kSize>& step, const double* in, Eigen::Index in_stride, double* out,
                Eigen::Index m, double* mean) {
  Eigen::Index at = 0;
  for (; at + kLane <= m; at += kLane) {
    filterLane<kSize, kLane>(step, in + at, in_stride, out + at, m, mean + kSize * at);
  }
  for (; at + 2 <= m; at += 2) filterLane<kSize, 2>(step, in + at, in_stride, out + at, m, mean + kSize * at);
  if (at < m) filterLane<kSize, 1>(step, in + at, in_stride, out + at, m, mean + kSize * at);
}

/// Adds the products of all pairs of m columns of some rows to the upper triangle of a gram.
void addProducts(const Rows& rows, Rows& gram) {
  const Eigen::Index m = gram.rows();
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index r = 0; r < rows.rows(); r += 3) {
      gram.row(i).tail(m - i) += rows(r, i) * rows.row(r).tail(m - i) +
                                 rows(r + 1, i) * rows.row(r + 1).tail(m - i) +
                                 rows(r + 2, i) * rows.row(r + 2).tail(m - i);
    }
  }
}

}  // namespace

Whitener::Whitener(const Eigen::MatrixXd& poses, const Eigen::VectorXd& times,
                   const Eigen::VectorXd& activity, const MotionNoise& noise) {
  check(poses, times, activity, noise);
  log_determinants_.resize(poses.rows() - 1, 3);
  if ((noise.slow.sd.array() > 0).any()) {
    steps_ = filter<2>(poses, times, activity, noise, log_determinants_);
  } else {
    steps_ = filter<1>(poses, times, activity, noise, log_determinants_);
  }
}

void Whitener::requireRows(const Eigen::Ref<const Rows>& columns) const {
  if (columns.rows() != 3 * log_determinants_.rows()) {
    throw std::invalid_argument("columns must have three rows per increment");
  }
}

Rows Whitener::whiten(const Eigen::Ref<const Rows>& columns) const {
  requireRows(columns);
  const Eigen::Index m = columns.cols();
  Rows out(columns.rows(), m);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(kLargest * m);
  std::visit(
      [&](const auto& steps) {
        Eigen::Index row = 0;
        for (const auto& step : steps) {
          filterStep(step, columns.row(row).data(), columns.outerStride(), out.row(row).data(), m,
                     mean.data());
          row += 3;
        }
      },
      steps_);
  return out;
}

Rows Whitener::gram(const Eigen::Ref<const Rows>& columns) const {
  requireRows(columns);
  const Eigen::Index m = columns.cols();
  Rows out = Rows::Zero(m, m);
  Rows white(3, m);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(kLargest * m);
  std::visit(
      [&](const auto& steps) {
        Eigen::Index row = 0;
        for (const auto& step : steps) {
          filterStep(step, columns.row(row).data(), columns.outerStride(), white.data(), m, mean.data());
          addProducts(white, out);
          row += 3;
        }
      },
      steps_);
  return out.selfadjointView<Eigen::Upper>();
}

}  // namespace kurumaisu
