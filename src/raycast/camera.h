// SPDX-License-Identifier: BSD-3-Clause
// A colour and depth camera among upright prisms, drawn column by column, without a display.
#pragma once

#include <cstdint>
#include <vector>

#include "raycast/column.h"

namespace kurumaisu {

/// An upright wall from a to b, in the frame of its body; heights above the body's base [m].
struct Panel {
  double ax, ay, bx, by;
  double low, high;
  std::uint32_t color;  ///< four bytes: red, green, blue, alpha
  std::int32_t prism;   ///< closed outline, counter-clockwise, that it is part of; -1: none
  std::int32_t body;
};

/// x, y, z [m], heading [rad] in the map.
struct Stand {
  double x, y, z, heading;
};

/// What a camera is: pixels, fields of view [rad], depths [m], tilt [rad] downward.
struct Optics {
  int width, height;
  double fov_h, fov_v;
  double near, far;
  double tilt;
};

/// Throws std::invalid_argument naming the value that makes no camera.
void validate(const Optics& optics);

/// Draws pictures; keeps its tables and its memory between them.
///
/// Pixel centres are sampled. Without tilt, a column of pixels is one half-plane and every pixel is exact. With
/// tilt, the half-planes are kFiner times as fine as the pixels and each pixel takes the nearest one.
class Camera {
 public:
  explicit Camera(const Optics& optics);

  /// rgba: height * width * 4 bytes; depth: height * width, along the optical axis [m]: -inf nearer than `near`,
  /// +inf where nothing is nearer than `far`, which is painted as the sky. Rows from top to bottom.
  ///
  /// stands: of each body; hidden: bodies not drawn. The heading of the eye is that of the optical axis.
  void render(const std::vector<Panel>& panels, const std::vector<Stand>& stands,
              const std::vector<char>& hidden, const Stand& eye, const Background& background,
              std::uint32_t* rgba, float* depth);

  const Optics& optics() const { return optics_; }

  static constexpr int kFiner = 4;

 private:
  /// Where a pixel looks.
  struct Sight {
    std::int32_t column;
    float slope;  ///< rise per horizontal distance
    float scale;  ///< depth per horizontal distance
  };
  struct Visible {
    std::int32_t panel;
    std::int32_t first, last;   ///< columns, half-open
    double ax, ay, bx, by, up;  ///< in the frame of the eye; up: of its body's base
  };

  void lookAhead();
  void lookDown();
  void setColumns(const std::vector<double>& azimuths);
  void cover(Visible visible);
  void addColumns(const Visible& visible, double from, double to);
  void findCrossings(const std::vector<Panel>& panels);
  void shade(const Background& background, std::uint32_t* rgba, float* depth);

  Optics optics_;
  double reach_ = 0.0;  ///< horizontal distance beyond which all is too far [m]
  std::vector<Sight> sights_;
  std::vector<double> order_;  ///< of each column: grows with its azimuth, see turn()
  std::vector<double> dx_, dy_;

  std::vector<Visible> visible_;
  std::vector<std::size_t> offsets_;  ///< of each column's crossings, and the total
  std::vector<std::size_t> fill_;
  std::vector<Crossing> crossings_;
  ColumnPainter painter_;
  std::vector<Span> spans_;
  std::vector<std::size_t> first_span_, at_span_;
};

}  // namespace kurumaisu
