// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/fan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "raycast/infinity.h"

namespace kurumaisu {
namespace {

constexpr double kEnd = 1e-9;  // [m] a ray that passes so near to a segment's end may also meet its neighbour
constexpr std::size_t kBlock = 16;  // beams for each pair of sine and cosine
constexpr double kWidest = 1.0;     // [rad] between two probes

/// Angle of x, y [rad] within 1e-5; NaN if both are 0.
inline float roughAngle(float x, float y) {
  const float ax = std::abs(x);
  const float ay = std::abs(y);
  const float q = std::min(ax, ay) / std::max(ax, ay);
  const float q2 = q * q;
  float a = -0.01172120F;  // minimax polynomial of atan on [0, 1]
  for (const float c : {0.05265332F, -0.11643287F, 0.19354346F, -0.33262347F, 0.99997726F}) a = a * q2 + c;
  a *= q;
  a = ay > ax ? 1.57079633F - a : a;
  a = x < 0 ? 3.14159265F - a : a;
  return y < 0 ? -a : a;
}

}  // namespace

Fan::Fan(const Scene& scene, const Pose2D& origin, double increment, std::size_t n)
    : scene_(scene),
      origin_(origin),
      increment_(increment),
      n_(n),
      dx_(n),
      dy_(n),
      ranges_(n),
      segments_(n),
      nearest_(n + 2, std::numeric_limits<float>::infinity()) {
  turn();
  place(scene.witnesses());
}

/// Directions of all beams: a block's first, times those within a block; no error grows along the fan.
void Fan::turn() {
  std::array<double, kBlock> c{};
  std::array<double, kBlock> s{};
  for (std::size_t j = 0; j < kBlock; ++j) {
    c[j] = std::cos(static_cast<double>(j) * increment_);
    s[j] = std::sin(static_cast<double>(j) * increment_);
  }
  for (std::size_t i = 0; i < n_; i += kBlock) {
    const double base_c = std::cos(origin_.theta + static_cast<double>(i) * increment_);
    const double base_s = std::sin(origin_.theta + static_cast<double>(i) * increment_);
    const std::size_t count = std::min(kBlock, n_ - i);
    for (std::size_t j = 0; j < count; ++j) {
      dx_[i + j] = base_c * c[j] - base_s * s[j];
      dy_[i + j] = base_s * c[j] + base_c * s[j];
    }
  }
}

/// Sorts the witnesses by the beams that they lie between.
void Fan::place(const std::vector<Point>& witnesses) {
  const double middle = origin_.theta + 0.5 * increment_ * static_cast<double>(n_ - 1);
  const auto c = static_cast<float>(std::cos(middle));
  const auto s = static_cast<float>(std::sin(middle));
  const auto per_angle = static_cast<float>(1 / increment_);
  const float half = 0.5F * static_cast<float>(n_ + 1);
  constexpr std::size_t kBatch = 64;  // a loop for the vector unit, then one for the scatter
  std::array<float, kBatch> at{};
  std::array<float, kBatch> squared{};
  for (std::size_t start = 0; start < witnesses.size(); start += kBatch) {
    const std::size_t count = std::min(kBatch, witnesses.size() - start);
    const Point* w = &witnesses[start];
    for (std::size_t j = 0; j < count; ++j) {
      const auto x = static_cast<float>(w[j].x - origin_.x);
      const auto y = static_cast<float>(w[j].y - origin_.y);
      at[j] = roughAngle(c * x + s * y, c * y - s * x) * per_angle + half;
      squared[j] = x * x + y * y;
    }
    for (std::size_t j = 0; j < count; ++j) {
      if (!(at[j] >= 0 && at[j] < static_cast<float>(n_ + 1))) continue;
      float& nearest = nearest_[static_cast<std::size_t>(at[j])];
      nearest = std::min(nearest, squared[j]);
    }
  }
}

void Fan::probe(std::size_t i) {
  const Hit hit = scene_.cast(ray(i), kInfinity);
  ranges_[i] = hit.range;
  segments_[i] = hit.segment;
}

/// True if all beams between beams i and k meet what these two meet.
bool Fan::joined(std::size_t i, std::size_t k) const {
  if (segments_[i] != segments_[k] || static_cast<double>(k - i) * std::abs(increment_) > kWidest)
    return false;
  const auto farthest = static_cast<float>(std::max(ranges_[i], ranges_[k]) * (1 + 1e-5));
  // One more on either side, for the witnesses' angles are rough.
  for (std::size_t w = i; w <= k + 1; ++w) {
    if (nearest_[w] < farthest * farthest) return false;
  }
  if (segments_[i] < 0) return true;
  const Segment& s = scene_.segment(segments_[i]);
  const Ends a = endsOf(ray(i), s);
  const Ends b = endsOf(ray(k), s);
  return std::min({std::abs(a.side_a), std::abs(a.side_b), std::abs(b.side_a), std::abs(b.side_b)}) > kEnd;
}

void Fan::fill(std::size_t i, std::size_t k) {
  const std::int32_t segment = segments_[i];
  std::fill(segments_.begin() + static_cast<std::ptrdiff_t>(i) + 1,
            segments_.begin() + static_cast<std::ptrdiff_t>(k), segment);
  if (segment < 0) {
    std::fill(ranges_.begin() + static_cast<std::ptrdiff_t>(i) + 1,
              ranges_.begin() + static_cast<std::ptrdiff_t>(k), kInfinity);
    return;
  }
  const Segment s = scene_.segment(segment);
  for (std::size_t m = i + 1; m < k; ++m) ranges_[m] = std::max(rangeToLine(endsOf(ray(m), s)), 0.0);
}

/// How many beams from beam i, counted along the fan (sense 1) or back (-1), until its segment ends.
double Fan::beamsToEnd(std::size_t i, double sense) const {
  const Ends e = endsOf(ray(i), scene_.segment(segments_[i]));
  const double sign = increment_ > 0 ? sense : -sense;
  const bool a = e.side_a * sign > e.side_b * sign;
  const double side = a ? e.side_a : e.side_b;
  const double along = a ? e.along_a : e.along_b;
  const double angle = roughAngle(static_cast<float>(along), static_cast<float>(side));
  return std::max(0.0, std::floor(sense * angle / increment_));
}

/// A beam between i and k, at best the last on the nearer of the two walls that they meet.
std::size_t Fan::split(std::size_t i, std::size_t k) const {
  const std::size_t middle = (i + k) / 2;
  if (segments_[i] == segments_[k]) return middle;
  const bool from_i = ranges_[i] <= ranges_[k];
  const double beams = beamsToEnd(from_i ? i : k, from_i ? 1.0 : -1.0);
  if (!(beams < static_cast<double>(k - i))) return middle;
  const std::size_t steps = std::max<std::size_t>(1, static_cast<std::size_t>(beams));
  return from_i ? i + steps : k - steps;
}

/// Ranges of the beams between i and k, which are known.
void Fan::solve(std::size_t i, std::size_t k) {
  while (k - i > 1) {
    if (joined(i, k)) return fill(i, k);
    const std::size_t m = split(i, k);
    probe(m);
    solve(m, k);
    k = m;
  }
}

void Fan::cast(double max_range, Hit* hits) {
  const double widest = std::max(1.0, std::floor(kWidest / std::abs(increment_)));
  probe(0);
  for (std::size_t i = 0; i + 1 < n_;) {
    const double beams = segments_[i] < 0 ? widest : std::clamp(beamsToEnd(i, 1.0), 1.0, widest);
    const std::size_t k = std::min(i + static_cast<std::size_t>(beams), n_ - 1);
    probe(k);
    solve(i, k);
    i = k;
  }
  for (std::size_t i = 0; i < n_; ++i) {
    hits[i] = ranges_[i] <= max_range ? Hit{ranges_[i], segments_[i]} : Hit{kInfinity, -1};
  }
}

}  // namespace kurumaisu
