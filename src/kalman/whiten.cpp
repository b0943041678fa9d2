// SPDX-License-Identifier: BSD-3-Clause
#include "kalman/whiten.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "kalman/covariance.h"
#include "kalman/lanes.h"
#include "model/wide.h"

namespace kurumaisu {
namespace {

using Way = Eigen::Matrix<double, 1, Track::Ways::ColsAtCompileTime>;

Jacobians jacobians(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Way& way) {
  const double c = std::cos(a.z());
  const double s = std::sin(a.z());
  const Eigen::Vector3d world = b - a;
  Jacobians j;
  j.to << c, s, 0, -s, c, 0, 0, 0, 1;
  j.from = -j.to;
  j.from(0, 2) = -s * world.x() + c * world.y();
  j.from(1, 2) = -c * world.x() - s * world.y();
  // An error of a speed acts along the heading, and one of the yaw rate swings the rest of the way. Without the late
  // ones, a reference better than that would make noise of the motion pass for an effect.
  j.motion << way[0], -way[1], -way[3], way[1], way[0], way[2], 0, 0, 1;
  j.late << way[4], -way[5], -way[7], way[5], way[4], way[6], 0, 0, 0;
  return j;
}

void checkFactors(const char* name, const Eigen::VectorXd& factors, Eigen::Index n) {
  if (factors.size() != n || !(factors.array() >= 0).all()) {
    throw std::invalid_argument(std::string(name) + " must have one factor per increment, none negative");
  }
}

void check(const Track& track, const MotionNoise& noise) {
  const auto& [poses, times, activity, rolling, ways] = track;
  const Eigen::Index n = poses.rows() - 1;
  if (n < 1 || poses.cols() != 3) throw std::invalid_argument("poses must have shape (n + 1, 3), n > 0");
  if (times.size() != n + 1) throw std::invalid_argument("times and poses must have the same length");
  if (!((times.tail(n) - times.head(n)).array() > 0).all()) {
    throw std::invalid_argument("times must increase");
  }
  checkFactors("activity", activity, n);
  checkFactors("rolling", rolling, n);
  if (ways.rows() != n || !ways.allFinite()) {
    throw std::invalid_argument("ways must have one finite row per increment");
  }
  if (!(noise.position_sd > 0 && noise.heading_sd > 0 && noise.fast.tau > 0 && noise.slow.tau > 0) ||
      !(noise.fast.sd.array() > 0).all() || !(noise.slow.sd.array() >= 0).all()) {
    throw std::invalid_argument("every noise parameter must be positive");
  }
  if (!(noise.lasting >= 0 && noise.lasting < 1 && noise.lasting_tau > 0)) {
    throw std::invalid_argument("lasting must be a share below 1, and lasting_tau positive");
  }
}

template <int kColours, bool kLasting>
KURUMAISU_INLINE auto filterAll(const Track& track, const MotionNoise& noise,
                                Eigen::MatrixX3d& log_determinants) {
  const auto& [poses, times, activity, rolling, ways] = track;
  Covariance<kColours, kLasting> covariance(noise);
  std::vector<Whitener::Step<decltype(covariance)::kSize>> steps(static_cast<std::size_t>(poses.rows() - 1));
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    Jacobians j = jacobians(poses.row(at).transpose(), poses.row(at + 1).transpose(), ways.row(at));
    j.rolling = rolling[at] * j.motion;
    j.motion *= activity[at];
    j.late *= activity[at];
    double logs[3];
    if (!covariance.advance(j, times[at + 1] - times[at], steps[k], logs)) {
      throw std::invalid_argument("the increments' covariance is singular");
    }
    log_determinants.row(at) << logs[0], logs[1], logs[2];
  }
  return steps;
}

// One clone per machine holds all sizes: what is inlined into it is compiled for that machine, too.
KURUMAISU_WIDE Whitener::Steps filter(const Track& track, const MotionNoise& noise,
                                      Eigen::MatrixX3d& log_determinants) {
  const bool two = (noise.slow.sd.array() > 0).any();
  const bool lasting = noise.lasting > 0;
  if (two && lasting) return filterAll<2, true>(track, noise, log_determinants);
  if (two) return filterAll<2, false>(track, noise, log_determinants);
  if (lasting) return filterAll<1, true>(track, noise, log_determinants);
  return filterAll<1, false>(track, noise, log_determinants);
}

KURUMAISU_WIDE void whitenSteps(const Whitener::Steps& steps, const Eigen::Ref<const Rows>& columns,
                                Rows& out) {
  if (const auto* six = std::get_if<std::vector<Whitener::Step<6>>>(&steps)) whitenAll(*six, columns, out);
  if (const auto* nine = std::get_if<std::vector<Whitener::Step<9>>>(&steps)) whitenAll(*nine, columns, out);
  if (const auto* twelve = std::get_if<std::vector<Whitener::Step<12>>>(&steps))
    whitenAll(*twelve, columns, out);
}

KURUMAISU_WIDE void gramOfSteps(const Whitener::Steps& steps, const Eigen::Ref<const Rows>& columns,
                                Rows& out) {
  if (const auto* six = std::get_if<std::vector<Whitener::Step<6>>>(&steps)) gramOfAll(*six, columns, out);
  if (const auto* nine = std::get_if<std::vector<Whitener::Step<9>>>(&steps)) gramOfAll(*nine, columns, out);
  if (const auto* twelve = std::get_if<std::vector<Whitener::Step<12>>>(&steps))
    gramOfAll(*twelve, columns, out);
}

}  // namespace

Whitener::Whitener(const Track& track, const MotionNoise& noise) {
  check(track, noise);
  log_determinants_.resize(track.poses.rows() - 1, 3);
  steps_ = filter(track, noise, log_determinants_);
}

void Whitener::requireRows(const Eigen::Ref<const Rows>& columns) const {
  if (columns.rows() != 3 * log_determinants_.rows()) {
    throw std::invalid_argument("columns must have three rows per increment");
  }
}

Rows Whitener::whiten(const Eigen::Ref<const Rows>& columns) const {
  requireRows(columns);
  Rows out(columns.rows(), columns.cols());
  whitenSteps(steps_, columns, out);
  return out;
}

Rows Whitener::gram(const Eigen::Ref<const Rows>& columns) const {
  requireRows(columns);
  Rows out(columns.cols(), columns.cols());
  gramOfSteps(steps_, columns, out);
  return out.selfadjointView<Eigen::Upper>();
}

}  // namespace kurumaisu
