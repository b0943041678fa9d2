// SPDX-License-Identifier: BSD-3-Clause
#include "base/odometry_report.h"

#include <cmath>

namespace kurumaisu {
namespace {

void addGyro(const Gyro& gyro, const GyroCounts& before, Report& report) {
  const GyroCounts& now = gyro.counts();
  const bool lost = now.fallbacks > before.fallbacks;
  const bool refused = now.refused > before.refused;
  if (lost || refused) {
    report.warning = true;
    report.summary = lost ? "the gyro stopped sending" : "samples of the gyro refused";
  } else {
    const char* why =
        gyro.bias() ? "open loop: the gyro is silent" : "open loop: the gyro's bias is not known yet";
    report.summary = gyro.inUse() ? "yaw by the gyro" : why;
    report.warning = !gyro.inUse();
  }
  report.values.emplace_back("gyro bias [rad/s]", gyro.bias() ? shown(gyro.bias()->rate) : "unknown");
  report.values.emplace_back("gyro samples", std::to_string(now.samples));
  report.values.emplace_back("refused gyro samples", std::to_string(now.refused));
  report.values.emplace_back("gyro fallbacks", std::to_string(now.fallbacks));
  report.values.emplace_back("gyro bias estimates", std::to_string(now.biases));
}

}  // namespace

std::string unfollowedWarning(const std::vector<std::string>& unfollowed) {
  if (unfollowed.empty()) return "";
  return "BASE_EFFECTS_NOT_FOLLOWED: the model has " + joined(unfollowed) +
         ", odometry does not: its covariance keeps the assumed growth";
}

Report reportOdometry(const Reckoning& reckoning, const std::vector<std::string>& unfollowed, bool measured,
                      const GyroCounts& before) {
  const Eigen::Matrix3d covariance = reckoning.odometry().covariance();
  Report report{!unfollowed.empty(), "open loop", {}};
  report.values = {{"noise", measured ? "measured" : "assumed"},
                   {"effects not followed", unfollowed.empty() ? "none" : joined(unfollowed)},
                   {"sd of x [m]", shown(std::sqrt(covariance(0, 0)))},
                   {"sd of y [m]", shown(std::sqrt(covariance(1, 1)))},
                   {"sd of heading [rad]", shown(std::sqrt(covariance(2, 2)))}};
  if (!unfollowed.empty()) report.summary += ", without " + joined(unfollowed);
  if (reckoning.gyro()) addGyro(*reckoning.gyro(), before, report);
  return report;
}

}  // namespace kurumaisu
