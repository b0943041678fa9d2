// SPDX-License-Identifier: BSD-3-Clause
// Errors of the rates that are forgotten little by little, over one increment.
#pragma once

namespace kurumaisu {

/// Discrete Ornstein-Uhlenbeck process of unit variance over dt, with its integral over the interval and its lateness:
/// the integral of u (t / dt - 1/2), which tells whether it acted late or early in the interval.
struct OuStep {
  double decay;         ///< u' = decay u + noise
  double reach;         ///< integral = reach u + noise [s]
  double late;          ///< lateness = late u + noise [s]; less than 0
  double var_u;         ///< of the noise in u'
  double var_integral;  ///< of the noise in the integral [s^2]
  double var_late;      ///< of the noise in the lateness [s^2]
  double cov;           ///< between those in u' and the integral [s]
  double cov_late;      ///< between those in u' and the lateness [s]
  double cov_both;      ///< between those in the integral and the lateness [s^2]
};

/// Over dt [s], of errors that are forgotten with the time constant tau [s].
OuStep ouStep(double dt, double tau);

}  // namespace kurumaisu
