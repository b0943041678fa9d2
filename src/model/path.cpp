// SPDX-License-Identifier: BSD-3-Clause
#include "model/path.h"

#include <algorithm>
#include <cstdint>

#include "model/wide.h"

namespace kurumaisu {
namespace {

constexpr std::size_t kLane = 8;
struct alignas(kLane * sizeof(double)) Lane {
  double of __attribute__((vector_size(kLane * sizeof(double))));
};
using Bits = std::int64_t __attribute__((vector_size(kLane * sizeof(std::int64_t))));

constexpr double kFarthest = 1e5;    // [rad] up to which an angle's quarter turns are taken off without loss
constexpr double kSmallTurn = 0.03;  // [rad] half of a step's turn up to which the series below is exact

/// Cosines and sines of angles up to kFarthest, within two units of the last place. The polynomials are those of
/// Sun's fdlibm, k_cos.c and k_sin.c, and so are the three parts of pi / 2, e_rem_pio2.c.
KURUMAISU_INLINE void cosSin(const Lane& angle, Lane& cosine, Lane& sine) {
  constexpr double kWhole =
      6755399441055744.0;  // 3 * 2^51: a sum with it is rounded, its last bits are the number's
  Lane shifted, r;
  shifted.of = angle.of * 0.63661977236758138 + kWhole;
  const auto turns = shifted.of - kWhole;
  r.of = angle.of - turns * 1.57079632673412561417e+00;
  r.of -= turns * 6.07710050630396597660e-11;
  r.of -= turns * 2.02226624879595063154e-21;
  const auto z = r.of * r.of;
  const auto s =
      r.of + r.of * z *
                 (-1.66666666666666324348e-01 +
                  z * (8.33333333332248946124e-03 +
                       z * (-1.98412698298579493134e-04 +
                            z * (2.75573137070700676789e-06 +
                                 z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
  const auto c =
      1.0 -
      (0.5 * z - z * z *
                     (4.16666666666666019037e-02 +
                      z * (-1.38888888888741095749e-03 +
                           z * (2.48015872894767294178e-05 +
                                z * (-2.75573143513906633035e-07 +
                                     z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));
  const Bits quarter = reinterpret_cast<Bits>(shifted.of);
  const auto swapped = (quarter & 1) != 0;
  const auto a = swapped ? s : c;
  const auto b = swapped ? c : s;
  cosine.of = ((quarter + 1) & 2) != 0 ? -a : a;
  sine.of = (quarter & 2) != 0 ? -b : b;
}

/// Eight steps at a time: the ways in the map, from the headings before the steps.
KURUMAISU_INLINE void ways(const Lane& v, const Lane& w, const Lane& dt, const Lane& heading, Lane& x,
                           Lane& y) {
  Lane direction, cosine, sine;
  const auto half = 0.5 * w.of * dt.of;
  const auto square = half * half;
  const auto chord = v.of * dt.of * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)));
  direction.of = heading.of + half;
  cosSin(direction, cosine, sine);
  x.of = chord * cosine.of;
  y.of = chord * sine.of;
}

}  // namespace

KURUMAISU_WIDE void integrate(const Pose2D& start, const Steps& steps, double* poses) {
  Pose2D pose = start;
  for (std::size_t at = 0; at < steps.n; at += kLane) {
    const std::size_t count = std::min(kLane, steps.n - at);
    Lane v{}, w{}, dt{}, heading{}, x{}, y{};
    bool plain = count == kLane;
    double theta = pose.theta;
    for (std::size_t i = 0; i < count; ++i) {
      v.of[i] = steps.v[at + i];
      w.of[i] = steps.w[at + i];
      dt.of[i] = steps.dt[at + i];
      heading.of[i] = theta;
      const double turn = w.of[i] * dt.of[i];
      theta += turn;
      plain = plain && turn < 2.0 * kSmallTurn && -turn < 2.0 * kSmallTurn && theta < kFarthest &&
              -theta < kFarthest;
    }
    if (plain) ways(v, w, dt, heading, x, y);
    for (std::size_t i = 0; i < count; ++i) {
      double* row = poses + 3 * (at + i);
      row[0] = pose.x;
      row[1] = pose.y;
      row[2] = pose.theta;
      pose = plain ? Pose2D{pose.x + x.of[i], pose.y + y.of[i], pose.theta + w.of[i] * dt.of[i]}
                   : advance(pose, v.of[i], w.of[i], dt.of[i]);
    }
  }
  double* row = poses + 3 * steps.n;
  row[0] = pose.x;
  row[1] = pose.y;
  row[2] = pose.theta;
}

}  // namespace kurumaisu
