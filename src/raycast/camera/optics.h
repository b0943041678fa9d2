// SPDX-License-Identifier: BSD-3-Clause
// Where the pixels of a camera look.
#pragma once

#include <cstdint>
#include <vector>

namespace kurumaisu {

/// What a camera is: pixels, fields of view [rad], depths [m], tilt [rad] downward.
struct Optics {
  int width, height;
  double fov_h, fov_v;
  double near, far;
  double tilt;
};

/// Throws std::invalid_argument naming the value that makes no camera.
void validate(const Optics& optics);

/// A number in [-2, 2] that grows with the angle of (x, y) in [-pi, pi], without trigonometry.
double turn(double x, double y);

/// Upright half-planes through the eye, ordered from right to left, and for each pixel the one it looks into.
///
/// Pixel centres are meant. Without tilt, a half-plane is a column of pixels, exactly. With tilt, half-planes are
/// kFiner times as fine as the pixels at the centre, and each pixel takes the nearest one.
struct Sights {
  struct Sight {
    std::int32_t column;
    float slope;  ///< rise per horizontal distance
    float scale;  ///< depth along the optical axis per horizontal distance
  };
  struct Column {
    double turn;    ///< of its direction
    double dx, dy;  ///< direction, the camera looking along x, its left being y
  };
  static constexpr int kFiner = 4;

  std::vector<Sight> pixels;  ///< row by row from the top
  std::vector<Column> columns;
  double reach;  ///< horizontal distance beyond which all is too far [m]
};

Sights makeSights(const Optics& optics);

}  // namespace kurumaisu
