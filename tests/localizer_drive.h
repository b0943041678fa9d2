// SPDX-License-Identifier: BSD-3-Clause
// Drives of a localiser through the room.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "slam/localization/localizer.h"
#include "slam_room.h"

namespace room::localizing {

constexpr double kStep = 0.1;  // [s] between scans
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

/// Written down here, so that tuning launch/localization_node.yaml cannot break this test.
inline k::LocalizerSettings settings() {
  const std::map<std::string, double> values{{"min_particles", 100},
                                             {"max_particles", 2000},
                                             {"kld_err", 0.05},
                                             {"kld_z", 0.99},
                                             {"update_min_d", 0.05},
                                             {"update_min_a", 0.05},
                                             {"ambiguous_spread", 0.5},
                                             {"laser_max_beams", 60},
                                             {"laser_max_range", 30},
                                             {"laser_correlation", 0.52},
                                             {"laser_sigma_hit", 0.05},
                                             {"laser_z_hit", 0.95},
                                             {"laser_z_rand", 0.05},
                                             {"laser_likelihood_max_dist", 0.4},
                                             {"laser_power", 0.2},
                                             {"odom_alpha1", 0.1},
                                             {"odom_alpha2", 0.05},
                                             {"odom_alpha3", 0.1},
                                             {"odom_alpha4", 0.01},
                                             {"odom_way_floor", 0.003},
                                             {"odom_turn_floor", 0.003},
                                             {"recovery_alpha_slow", 0.002},
                                             {"recovery_alpha_fast", 0.15},
                                             {"lost_fit", 0.5},
                                             {"lost_drop", 0.6},
                                             {"found_fit", 0.88},
                                             {"found_odds", 1000},
                                             {"found_way", 2},
                                             {"search_power", 0.05},
                                             {"search_step", 0.2},
                                             {"search_angle_step", 0.105},
                                             {"search_positions_per_scan", 5000},
                                             {"search_places", 300}};
  return k::makeLocalizerSettings([&values](const std::string& key) { return values.at(key); });
}

inline const k::Chair kChair{{1, 0, {0.002334, -0.000488, 0.000199}, 0.001, 0.06, 5.6}, {0, 0, 1, 0}};

inline k::Localizer localizer(std::uint32_t seed = 1,
                              const k::OccupancyGrid& grid = room::mapOf(room::kWalls, 0.05)) {
  return {settings(), kChair, seed, grid, room::kMapFromGrid};
}

inline k::Gaussian around(const k::Pose2D& pose) {
  k::Gaussian out{pose, Eigen::Matrix3d::Zero()};
  out.covariance.diagonal() << 0.04, 0.04, 0.01;
  return out;
}

struct Moment {
  double t, off, turn, sd;
  k::Localizer::Estimate estimate;
};

/// What happens to scan and odometry on their way; the odometry is that of the first and the last beam.
using Fault = std::function<void(double t, k::Scan& scan, k::Pose2D& start, k::Pose2D& end)>;

inline const Fault kNone = [](double, k::Scan&, k::Pose2D&, k::Pose2D&) {};

/// Drives from one time to another.
inline std::vector<Moment> drive(k::Localizer& localizer, double from, double to,
                                 const Fault& fault = kNone) {
  std::vector<Moment> out;
  room::Wheels wheels;
  std::mt19937 noise(7);
  for (int i = static_cast<int>(std::lround(from / kStep)); i < static_cast<int>(std::lround(to / kStep));
       ++i) {
    const double t = i * kStep;
    k::Scan scan = room::scanAt(t, noise);
    k::Pose2D start = wheels.at(t);
    k::Pose2D end = wheels.at(t + room::kUrg.time_increment * (room::kBeams - 1));
    fault(t, scan, start, end);
    const auto estimate = localizer.add(scan, {scan.stamp, start, std::nullopt}, end);
    const k::Pose2D true_pose = room::truth(t);
    const auto& mean = estimate.map_from_base.mean;
    const auto& covariance = estimate.map_from_base.covariance;
    out.push_back({t, std::hypot(mean.x - true_pose.x, mean.y - true_pose.y),
                   std::abs(k::wrapAngle(mean.theta - true_pose.theta)),
                   std::sqrt(covariance(0, 0) + covariance(1, 1)), estimate});
  }
  return out;
}

bool sure(const Moment& moment) { return moment.estimate.knowledge == k::Knowledge::kTracking; }

/// Scans at which it was sure of a place where the chair was not.
inline int confidentlyWrong(const std::vector<Moment>& moments) {
  return static_cast<int>(
      std::count_if(moments.begin(), moments.end(), [](const Moment& m) { return sure(m) && m.off > 0.5; }));
}

inline double rootMeanSquare(const std::vector<Moment>& moments) {
  double sum = 0;
  for (const Moment& m : moments) sum += m.off * m.off;
  return std::sqrt(sum / static_cast<double>(moments.size()));
}

/// Drives with a fault from the true pose on.
inline std::vector<Moment> faulty(const Fault& fault, double seconds = 40) {
  k::Localizer subject = localizer();
  subject.setPose(around(room::truth(0)));
  return drive(subject, 0, seconds, fault);
}

inline void expectFollowed(const std::vector<Moment>& moments, double limit) {
  EXPECT_LT(rootMeanSquare(moments), limit);
  EXPECT_TRUE(sure(moments.back()));
  EXPECT_EQ(confidentlyWrong(moments), 0);
}

}  // namespace room::localizing
