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

void check(const Eigen::MatrixXd& poses, const Eigen::VectorXd& times, const Eigen::MatrixXd& columns,
           const Eigen::VectorXd& activity, const MotionNoise& noise) {
  const Eigen::Index n = poses.rows() - 1;
  if (n < 1 || poses.cols() != 3) throw std::invalid_argument("poses must have shape (n + 1, 3), n > 0");
  if (times.size() != n + 1) throw std::invalid_argument("times and poses must have the same length");
  if (columns.rows() != 3 * n) throw std::invalid_argument("columns must have three rows per increment");
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
Whitened filter(const Eigen::MatrixXd& poses, const Eigen::VectorXd& times, const Eigen::MatrixXd& columns,
                const Eigen::VectorXd& activity, const MotionNoise& noise) {
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

  Whitened out{Eigen::MatrixXd(columns.rows(), columns.cols()), Eigen::MatrixX3d(n, 3)};
  using Mean = Eigen::Matrix<double, kSize, Eigen::Dynamic>;
  Mean mean = Mean::Zero(kSize, columns.cols());
  Eigen::Matrix<double, 3, Eigen::Dynamic> innovation(3, columns.cols());

  for (Eigen::Index k = 0; k < n; ++k) {
    Jacobians j = jacobians(poses.row(k).transpose(), poses.row(k + 1).transpose());
    j.motion *= activity[k];

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
      const OuStep ou = ouStep(times[k + 1] - times[k], colours[c].tau);
      h.template middleCols<3>(3 + 3 * c) = ou.reach * j.motion;
      q.template block<3, 3>(3 + 3 * c, 3 + 3 * c) = ou.var_u * rate_cov[c];
      keep.template segment<3>(3 + 3 * c).setConstant(ou.decay);
      shared.template middleRows<3>(3 + 3 * c) = ou.cov * rate_cov[c] * j.motion.transpose();
      fresh += j.motion * (ou.var_integral * rate_cov[c]) * j.motion.transpose();
    }

    const Eigen::Matrix<double, kSize, 3> seen = cov * h.transpose();
    const Eigen::LLT<Matrix3> llt(h * seen + fresh);
    if (llt.info() != Eigen::Success) throw std::invalid_argument("the increments' covariance is singular");
    innovation.noalias() = columns.middleRows(3 * k, 3) - h * mean;
    out.columns.middleRows(3 * k, 3) = llt.matrixL().solve(innovation);
    out.log_determinants.row(k) = 2.0 * llt.matrixLLT().diagonal().array().log().transpose();

    const Eigen::Matrix<double, kSize, 3> cross = keep.asDiagonal() * seen + shared;
    const Eigen::Matrix<double, kSize, 3> gain = llt.solve(cross.transpose()).transpose();
    mean = (keep.asDiagonal() * mean).eval();
    mean.noalias() += gain * innovation;
    cov = (keep.asDiagonal() * cov * keep.asDiagonal()).eval() + q - gain * cross.transpose();
    cov = 0.5 * (cov + cov.transpose()).eval();
  }
  return out;
}

}  // namespace

Whitened whiten(const Eigen::MatrixXd& poses, const Eigen::VectorXd& times, const Eigen::MatrixXd& columns,
                const Eigen::VectorXd& activity, const MotionNoise& noise) {
  check(poses, times, columns, activity, noise);
  const bool two = (noise.slow.sd.array() > 0).any();
  return two ? filter<2>(poses, times, columns, activity, noise)
             : filter<1>(poses, times, columns, activity, noise);
}

}  // namespace kurumaisu
