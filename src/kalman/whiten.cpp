// SPDX-License-Identifier: BSD-3-Clause
#include "kalman/whiten.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <stdexcept>

namespace kurumaisu {
namespace {

using Matrix3 = Eigen::Matrix3d;
using State = Eigen::Matrix<double, 6, 6>;        // of e_k (pose error, map frame) and u_k (rate error)
using Increments = Eigen::Matrix<double, 3, 6>;   // e_k, u_k to one increment

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
  const double spread = x < 1e-2 ? 2.0 / 3.0 * x * x * x - 0.5 * x * x * x * x
                                 : 2.0 * x - 4.0 * lost - std::expm1(-2.0 * x);
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
           const MotionNoise& noise) {
  const Eigen::Index n = poses.rows() - 1;
  if (n < 1 || poses.cols() != 3) throw std::invalid_argument("poses must have shape (n + 1, 3), n > 0");
  if (times.size() != n + 1) throw std::invalid_argument("times and poses must have the same length");
  if (columns.rows() != 3 * n) throw std::invalid_argument("columns must have three rows per increment");
  if (!((times.tail(n) - times.head(n)).array() > 0).all()) {
    throw std::invalid_argument("times must increase");
  }
  if (!(noise.position_sd > 0 && noise.heading_sd > 0 && noise.process_tau > 0) ||
      !(noise.process_sd.array() > 0).all()) {
    throw std::invalid_argument("every noise parameter must be positive");
  }
}

}  // namespace

Whitened whiten(const Eigen::MatrixXd& poses, const Eigen::VectorXd& times, const Eigen::MatrixXd& columns,
                const MotionNoise& noise) {
  check(poses, times, columns, noise);
  const Eigen::Index n = poses.rows() - 1;
  const Matrix3 pose_cov =
      Eigen::Vector3d(noise.position_sd, noise.position_sd, noise.heading_sd).array().square().matrix().asDiagonal();
  const Matrix3 rate_cov = noise.process_sd.array().square().matrix().asDiagonal();

  Whitened out{Eigen::MatrixXd(columns.rows(), columns.cols()), Eigen::VectorXd(n)};
  State cov = State::Zero();
  cov.topLeftCorner<3, 3>() = pose_cov;
  cov.bottomRightCorner<3, 3>() = rate_cov;
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(6, columns.cols());

  for (Eigen::Index k = 0; k < n; ++k) {
    const Jacobians j = jacobians(poses.row(k).transpose(), poses.row(k + 1).transpose());
    const OuStep ou = ouStep(times[k + 1] - times[k], noise.process_tau);

    Increments h;
    h << j.from, ou.reach * j.motion;
    const Matrix3 fresh =  // of e_{k+1} and of the integral's noise
        j.to * pose_cov * j.to.transpose() + j.motion * (ou.var_integral * rate_cov) * j.motion.transpose();
    const Matrix3 innovation_cov = h * cov * h.transpose() + fresh;
    const Eigen::LLT<Matrix3> llt(innovation_cov);
    if (llt.info() != Eigen::Success) throw std::invalid_argument("the increments' covariance is singular");
    const Eigen::MatrixXd innovation = columns.middleRows(3 * k, 3) - h * mean;
    out.columns.middleRows(3 * k, 3) = llt.matrixL().solve(innovation);
    out.log_determinants[k] = 2.0 * llt.matrixLLT().diagonal().array().log().sum();

    // Next state (e_{k+1}, u_{k+1}) and its covariance with this increment.
    State f = State::Zero();
    f.bottomRightCorner<3, 3>() = ou.decay * Matrix3::Identity();
    State q = State::Zero();
    q.topLeftCorner<3, 3>() = pose_cov;
    q.bottomRightCorner<3, 3>() = ou.var_u * rate_cov;
    Eigen::Matrix<double, 6, 3> cross = f * cov * h.transpose();
    cross.topRows<3>() += pose_cov * j.to.transpose();
    cross.bottomRows<3>() += ou.cov * rate_cov * j.motion.transpose();
    const Eigen::Matrix<double, 6, 3> gain = llt.solve(cross.transpose()).transpose();
    mean = f * mean + gain * innovation;
    cov = f * cov * f.transpose() + q - gain * cross.transpose();
    cov = 0.5 * (cov + cov.transpose()).eval();
  }
  return out;
}

}  // namespace kurumaisu
