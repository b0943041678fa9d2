// SPDX-License-Identifier: BSD-3-Clause
// MRPT's Monte Carlo localisation with its adaptive number of particles. No MRPT type in this header.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "slam/basics/gaussian.h"
#include "slam/localization/settings.h"

namespace kurumaisu {

/// Equal seeds and calls give equal particles, bit by bit.
class Particles {
 public:
  Particles(const LocalizerSettings& settings, std::uint32_t seed);
  ~Particles();

  /// Draws min_particles from a distribution.
  void reset(const Gaussian& pose);

  /// Moves the particles by a motion of base (in its own frame) with its noise, and weighs them.
  void update(const Gaussian& motion, const std::function<double(const Pose2D&)>& log_likelihood);

  std::vector<Weighted> all() const;

 private:
  struct Mcl;
  void seedRandom();

  LocalizerSettings settings_;
  std::uint32_t seed_;
  std::uint32_t rounds_ = 0;
  std::unique_ptr<Mcl> mcl_;
};

/// Mean and covariance of weighted poses.
Gaussian spread(const std::vector<Weighted>& poses);

}  // namespace kurumaisu
