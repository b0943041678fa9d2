// SPDX-License-Identifier: BSD-3-Clause
#include "base/odometry/odometry.h"

#include <cmath>
#include <stdexcept>

namespace kurumaisu {
namespace {

constexpr double kUsual = 0.8;  // [m/s, rad/s] rates in whose units base.process_noise grows: its formula
constexpr int kNoise = 3, kBias = 5, kScale = 6;  // where these errors begin
enum Along { kForward, kLateral, kHeading };

/// Variance that an Ornstein-Uhlenbeck process of variance 1 adds to its integral over h time constants, in
/// squares of the time constant, once its start is known.
double newInIntegral(double h) {
  if (h < 0.01) return h * h * h * (2.0 / 3 - h * (0.5 - h * 7 / 30));  // else a difference of equal numbers
  return 2 * h - 3 + 4 * std::exp(-h) - std::exp(-2 * h);
}

}  // namespace

struct Odometry::Step {
  double dt;                  // [s]
  double angle;               // turned [rad]
  bool measured;              // by a gyro
  Eigen::Matrix3d by_pose;    // d(pose) / d(pose before)
  Eigen::Matrix3d by_motion;  // d(pose) / d(forward, lateral, heading) added along the chord
  Eigen::Vector3d white;      // variances of forward, lateral, heading
  Eigen::Vector2d size;       // sd of the rates' noise: v, w
  double tau;                 // its time constant [s]
};

Odometry::Odometry(const OdometryNoise& noise) : noise_(noise) {
  covariance_.setZero();
  covariance_.diagonal().segment<2>(kNoise).setOnes();
  reset();
}

void Odometry::reset(const Pose2D& pose, const Eigen::Matrix3d& covariance) {
  pose_ = pose;
  covariance_.topRows<3>().setZero();
  covariance_.leftCols<3>().setZero();
  covariance_.topLeftCorner<3, 3>() = covariance;
  v_ = w_ = 0;
  rate_variance_.setZero();
}

void Odometry::setGyroBias(double variance, double walk) {
  covariance_.row(kBias).setZero();
  covariance_.col(kBias).setZero();
  covariance_(kBias, kBias) = variance;
  bias_walk_ = walk;
}

void Odometry::advance(double v, double w, double dt) { move(v, w, dt, nullptr); }

void Odometry::advance(double v, const Turn& turn, double dt) { move(v, turn.angle / dt, dt, &turn); }

void Odometry::move(double v, double w, double dt, const Turn* turn) {
  if (!(dt > 0)) throw std::invalid_argument("dt must be positive: " + std::to_string(dt));
  const Pose2D before = pose_;
  pose_ = kurumaisu::advance(before, v, w, dt);

  Step step{};
  step.dt = dt;
  step.angle = w * dt;
  step.measured = turn != nullptr;
  const double distance = std::abs(v) * dt;
  const double angle = std::abs(w) * dt;
  step.white << noise_.forward_per_distance * distance + noise_.forward_per_turn * angle,
      noise_.lateral_per_distance * distance,
      turn ? turn->variance : noise_.heading_per_distance * distance + noise_.heading_per_turn * angle;
  const bool moving = v != 0 || w != 0;
  const double growth = moving ? 1 + noise_.rates.growth * (std::abs(v) + std::abs(w)) / kUsual : 0;
  step.size << growth * noise_.rates.sd_v, turn ? 0 : growth * noise_.rates.sd_w;
  step.tau = noise_.rates.tau;

  const double dx = pose_.x - before.x;
  const double dy = pose_.y - before.y;
  step.by_pose << 1, 0, -dy, 0, 1, dx, 0, 0, 1;
  // Heading grows evenly, so half of it bends the chord.
  const double direction = 0.5 * (before.theta + pose_.theta);
  const double c = std::cos(direction);
  const double s = std::sin(direction);
  step.by_motion << c, -s, -0.5 * dy, s, c, 0.5 * dx, 0, 0, 1;
  spread(step);
  v_ = v;
  w_ = w;
}

void Odometry::spread(const Step& step) {
  Matrix7d by_before = Matrix7d::Identity();
  by_before.topLeftCorner<3, 3>() = step.by_pose;
  Matrix7d added = Matrix7d::Zero();
  added.topLeftCorner<3, 3>() = step.by_motion * step.white.asDiagonal() * step.by_motion.transpose();
  addRateNoise(step, by_before, added);
  rate_variance_ = step.white / (step.dt * step.dt);
  rate_variance_[kForward] += 2 * step.tau * step.size[0] * step.size[0] / step.dt;
  rate_variance_[kHeading] += 2 * step.tau * step.size[1] * step.size[1] / step.dt;
  if (step.measured) {
    added(kBias, kBias) = bias_walk_ * bias_walk_ * step.dt;
    by_before.block<3, 1>(0, kBias) = step.dt * step.by_motion.col(kHeading);
    by_before.block<3, 1>(0, kScale) = step.angle * step.by_motion.col(kHeading);
    const double rate = step.angle / step.dt;
    rate_variance_[kHeading] += covariance_(kBias, kBias) + covariance_(kScale, kScale) * rate * rate;
  }
  covariance_ = (by_before * covariance_ * by_before.transpose() + added).eval();
}

/// Ornstein-Uhlenbeck processes n and their integrals over the step, exactly: both go on from n with what is
/// left of it, and both get new noise, which is correlated.
void Odometry::addRateNoise(const Step& step, Matrix7d& by_before, Matrix7d& added) {
  const double left = std::exp(-step.dt / step.tau);
  const double reach = step.tau * (1 - left);  // [s] integral of what is left of n = 1
  const double level = 1 - left * left;        // variance new in n
  const double both = step.tau * (1 - left) * (1 - left);
  const double sum = step.tau * step.tau * newInIntegral(step.dt / step.tau);
  constexpr Along kAlong[] = {kForward, kHeading};
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d moved = step.size[i] * step.by_motion.col(kAlong[i]);
    by_before(kNoise + i, kNoise + i) = left;
    by_before.block<3, 1>(0, kNoise + i) = reach * moved;
    added(kNoise + i, kNoise + i) = level;
    added.block<3, 1>(0, kNoise + i) = both * moved;
    added.block<1, 3>(kNoise + i, 0) = both * moved.transpose();
    added.topLeftCorner<3, 3>() += sum * moved * moved.transpose();
  }
}

}  // namespace kurumaisu
