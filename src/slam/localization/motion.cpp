// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

Eigen::Matrix3d turning(double angle) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  turn.topLeftCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return turn;
}

/// d (a * b) / d a, along the axes of a's parent.
Eigen::Matrix3d lever(const Pose2D& from, const Pose2D& to) {
  Eigen::Matrix3d out = Eigen::Matrix3d::Identity();
  out(0, 2) = -(to.y - from.y);
  out(1, 2) = to.x - from.x;
  return out;
}

/// What a covariance has grown by, in base's frame at the first pose; none where it has not.
std::optional<Eigen::Matrix3d> growth(const Odometry& first, const Odometry& second) {
  if (!first.covariance || !second.covariance) return std::nullopt;
  const Eigen::Matrix3d carried = lever(first.pose, second.pose);
  const Eigen::Matrix3d turn = turning(-first.pose.theta);
  Eigen::Matrix3d grown =
      turn * (*second.covariance - carried * *first.covariance * carried.transpose()) * turn.transpose();
  const bool sound =
      grown.allFinite() && grown(0, 0) > 0 && grown(2, 2) > 0 &&
      Eigen::LLT<Eigen::Matrix3d>(grown + 1e-12 * Eigen::Matrix3d::Identity()).info() == Eigen::Success;
  if (!sound) return std::nullopt;
  return grown;
}

/// Of a chair that drives where it heads: a wrong turn takes it aside by half of it times the way.
Eigen::Matrix3d unicycle(double way, double heading, double way_variance, double turn_variance) {
  Eigen::Matrix3d noise = Eigen::Matrix3d::Zero();
  noise(0, 0) = way_variance;
  noise(2, 2) = turn_variance;
  noise(1, 2) = noise(2, 1) = 0.5 * way * turn_variance;
  noise(1, 1) = way * way * turn_variance / 3;
  const Eigen::Matrix3d turn = turning(heading);
  return turn * noise * turn.transpose();
}

/// Variance of the integral over a time of Ornstein-Uhlenbeck noise of unit deviation [s^2].
double integrated(double time, double tau) {
  return 2 * tau * std::fmax(0.0, time - tau * (1 - std::exp(-time / tau)));
}

}  // namespace

Gaussian motionBetween(const Odometry& first, const Odometry& second, const MotionSettings& settings,
                       const RateNoise& process) {
  Pose2D motion = between(first.pose, second.pose);
  motion.theta = wrapAngle(motion.theta);
  const double way = std::hypot(motion.x, motion.y);
  const double turned = std::abs(motion.theta);
  const double heading = way > 0 ? std::atan2(motion.y, motion.x) : 0;
  const double time = std::fmax(second.stamp - first.stamp, 0.0);
  const auto odometry = growth(first, second);
  Eigen::Matrix3d noise =
      odometry ? *odometry
               : unicycle(way, heading, settings.alpha3 * way * way + settings.alpha4 * turned * turned,
                          settings.alpha1 * turned * turned + settings.alpha2 * way * way);
  if (time > 0 && (way > 0 || turned > 0) && process.tau > 0) {
    constexpr double kUsual = 0.8;  // [m/s, rad/s] rates in whose units the noise grows, as in the effect
    const double size = 1 + process.growth * (way + turned) / time / kUsual;
    const double spread = size * size * integrated(time, process.tau);
    noise +=
        unicycle(way, heading, spread * process.sd_v * process.sd_v, spread * process.sd_w * process.sd_w);
  }
  noise.diagonal() +=
      Eigen::Vector3d(settings.way_floor * settings.way_floor, settings.way_floor * settings.way_floor,
                      settings.turn_floor * settings.turn_floor);
  return {motion, noise};
}

Gaussian moved(const Gaussian& pose, const Gaussian& motion) {
  const Pose2D mean = compose(pose.mean, motion.mean);
  const Eigen::Matrix3d carried = lever(pose.mean, mean);
  const Eigen::Matrix3d turn = turning(pose.mean.theta);
  return {mean,
          carried * pose.covariance * carried.transpose() + turn * motion.covariance * turn.transpose()};
}

}  // namespace kurumaisu
