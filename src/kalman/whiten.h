// SPDX-License-Identifier: BSD-3-Clause
// Kalman filter that whitens the residuals of body increments between noisy reference poses.
#pragma once

#include <Eigen/Core>
#include <array>
#include <variant>
#include <vector>

namespace kurumaisu {

/// One Ornstein-Uhlenbeck process of the rates.
struct Colour {
  Eigen::Vector3d
      sd;      ///< stationary: v [m/s], lateral [m/s], w [rad/s]; of the second colour, 0 where there is none
  double tau;  ///< time constant [s]
};

/// Noise of the reference pose and of the motion itself, whose two colours add up.
struct MotionNoise {
  double position_sd;  ///< reference pose, each axis of the map frame [m]
  double heading_sd;   ///< reference pose [rad]
  Colour fast;
  Colour slow;
  double lasting;      ///< share of the variance of the reference's errors that lasts; the rest is white
  double lasting_tau;  ///< for how long it lasts [s]
};

/// Where a robot was, and how it went from pose to pose.
struct Track {
  using Ways = Eigen::Matrix<double, Eigen::Dynamic, 8, Eigen::RowMajor>;

  Eigen::MatrixXd poses;     ///< (n + 1, 3) reference x, y [m], theta [rad]
  Eigen::VectorXd times;     ///< (n + 1,) increasing [s]
  Eigen::VectorXd activity;  ///< (n,) factors on the noise of the rates, 0 for a robot that is held at rest
  /// (n,) factors on noise as strong that an increment shares with no other, for a robot of which nobody knows whether
  /// it is shaken still.
  Eigen::VectorXd rolling;
  /// Of each increment, in the frame of its first pose: means of the heading's cosine and sine and of the way x, y [m]
  /// that lies ahead; and by how much each of them grows from its beginning to its end, by least squares.
  Ways ways;
};

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Whitens columns of residual increments: L^-1 X with L L' the joint covariance of all increments of a run.
///
/// The error of pose k is shared by the increments k - 1 and k; it lives in the map frame, so its share rotates with
/// the robot. A part of it may last for longer, as errors of a map do. What the filter does depends on no column: it is
/// worked out once, O(n), for any number of columns.
class Whitener {
 public:
  /// Throws std::invalid_argument for shapes that do not fit, times that do not increase, or noise that is not
  /// positive.
  Whitener(const Track& track, const MotionNoise& noise);

  /// Columns (3 n, m), row 3k..3k+2 being dx, dy [m] and dtheta [rad] of increment k in the body frame at pose k; O(n m).
  /// Throws std::invalid_argument for another number of rows.
  Rows whiten(const Eigen::Ref<const Rows>& columns) const;

  /// Products (m, m) of all pairs of such columns, whitened: what whiten(X)' whiten(X) is, without room for them.
  Rows gram(const Eigen::Ref<const Rows>& columns) const;

  /// Per increment, the log variances of dx, of dy given dx, and of dtheta given both, all given the increments before
  /// it; their sum is the log determinant of the joint covariance.
  const Eigen::MatrixX3d& logDeterminants() const { return log_determinants_; }

  /// One increment of the filter whose state has `size` numbers: errors of the pose and of the rates.
  template <int size>
  struct Step {
    std::array<std::array<double, size>, 3> seen;  ///< state to increment
    std::array<std::array<double, 3>, size> gain;  ///< innovation to the next state
    std::array<double, size> keep;                 ///< share of the state that the next one keeps
    std::array<double, 6> lower;                   ///< innovation to whitened: rows of a lower triangle
  };

  /// All increments: of one colour, of two or of one beside lasting errors, and of two beside them.
  using Steps = std::variant<std::vector<Step<6>>, std::vector<Step<9>>, std::vector<Step<12>>>;

 private:
  void requireRows(const Eigen::Ref<const Rows>& columns) const;

  Steps steps_;
  Eigen::MatrixX3d log_determinants_;
};

}  // namespace kurumaisu
