// SPDX-License-Identifier: BSD-3-Clause
#include "plausible/covariance.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "plausible/quantity.h"

namespace kurumaisu {
namespace {

constexpr double kRounding = 1e-9;  // of the greatest variance
constexpr const char* kNames[] = {"x", "y", "yaw"};

}  // namespace

void requireCovariance(const Eigen::Matrix3d& covariance) {
  for (int i = 0; i < 3; ++i) {
    require(plausible::kVariance, std::string("variance of ") + kNames[i], covariance(i, i));
  }
  const double slack = kRounding * covariance.diagonal().maxCoeff();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) {
      const double one = covariance(i, j);
      const double other = covariance(j, i);
      if (std::abs(one - other) <= slack) continue;
      std::ostringstream text;
      text << "covariance of " << kNames[j] << " and " << kNames[i]
           << ": must be the same number twice: " << other << " and " << one;
      throw std::invalid_argument(text.str());
    }
  }
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance, Eigen::EigenvaluesOnly)
                           .eigenvalues()
                           .minCoeff();
  if (least >= -slack) return;
  std::ostringstream text;
  text << "covariance of x, y, yaw: must be positive semi-definite: its least eigenvalue is " << least
       << ", so a covariance is greater than its variances allow";
  throw std::invalid_argument(text.str());
}

}  // namespace kurumaisu
