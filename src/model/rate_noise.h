// SPDX-License-Identifier: BSD-3-Clause
// What floor, tyres and casters add to the rates of a moving chair.
#pragma once

namespace kurumaisu {

/// Noise of the rates as the critic measures it, the model file's base.process_noise: on a moving chair
/// v + sd_v g n_v and w + sd_w g n_w, where n are Ornstein-Uhlenbeck processes of variance 1 and time constant
/// tau, and g = 1 + growth (|v| + |w|) / 0.8.
struct RateNoise {
  double sd_v = 0;    ///< [m/s]
  double sd_w = 0;    ///< [rad/s]
  double tau = 1;     ///< [s]
  double growth = 0;  ///< [1]
};

}  // namespace kurumaisu
