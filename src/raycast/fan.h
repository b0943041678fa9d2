// SPDX-License-Identifier: BSD-3-Clause
// Many beams from one place: most of them meet the wall that their neighbour meets.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/unicycle.h"
#include "raycast/ray.h"
#include "raycast/scene.h"
#include "raycast/witnesses.h"

namespace kurumaisu {

/// Casts a few beams, and computes those between two of them from the wall that both meet.
///
/// The answer is that of a cast for each beam, but for rounding: see findWitnesses for why nothing hides between.
class Fan {
 public:
  /// Beam i points along the origin's theta + i * increment [rad], which is not 0; n is at least 1.
  ///
  /// The whole fan must be less than a turn by at least two increments.
  Fan(const Scene& scene, const Pose2D& origin, double increment, std::size_t n);

  void cast(double max_range, Hit* hits);

 private:
  void turn();
  void place(const std::vector<Point>& witnesses);
  Ray ray(std::size_t i) const { return {origin_.x, origin_.y, dx_[i], dy_[i]}; }
  void probe(std::size_t i);
  void solve(std::size_t i, std::size_t k);
  bool joined(std::size_t i, std::size_t k) const;
  void fill(std::size_t i, std::size_t k);
  std::size_t split(std::size_t i, std::size_t k) const;
  double beamsToEnd(std::size_t i, double sense) const;

  const Scene& scene_;
  Pose2D origin_;
  double increment_;
  std::size_t n_;
  std::vector<double> dx_, dy_;         // of each beam
  std::vector<double> ranges_;          // [m]
  std::vector<std::int32_t> segments_;  // that each beam meets
  std::vector<float> nearest_;  // squared distance [m^2] of the nearest witness between beams i - 1 and i
};

}  // namespace kurumaisu
