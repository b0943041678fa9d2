// SPDX-License-Identifier: BSD-3-Clause
// A colour and depth camera among upright prisms, drawn column by column, without a display.
#pragma once

#include <cstdint>
#include <vector>

#include "raycast/bodies.h"
#include "raycast/camera/column.h"
#include "raycast/camera/optics.h"

namespace kurumaisu {

/// An upright wall from a to b, in the frame of its body; heights above the body's base [m].
struct Panel {
  double ax, ay, bx, by;
  double low, high;
  std::uint32_t color;  ///< four bytes: red, green, blue, alpha
  std::int32_t prism;   ///< closed outlines that it is part of; -1: none
  std::int32_t body;
};

/// Draws pictures; keeps its tables and its memory between them.
///
/// Every pixel is exact, but for what Sights says of tilted cameras.
class Camera {
 public:
  explicit Camera(const Optics& optics);

  /// rgba: height * width * 4 bytes; depth: height * width, along the optical axis [m]: -inf nearer than `near`,
  /// +inf where nothing is nearer than `far`, which is painted as the sky. Rows from top to bottom.
  ///
  /// poses: of each body; hidden: bodies not drawn. The heading of the eye is that of the optical axis.
  void render(const std::vector<Panel>& panels, const std::vector<Pose>& poses,
              const std::vector<char>& hidden, const Pose& eye, const Background& background,
              std::uint32_t* rgba, float* depth);

  const Optics& optics() const { return optics_; }

 private:
  struct Visible {
    std::int32_t panel;
    std::int32_t first, last;   ///< columns, half-open
    double ax, ay, bx, by, up;  ///< in the frame of the eye; up: of its body's base
  };

  void place(const std::vector<Panel>& panels, const std::vector<Pose>& poses,
             const std::vector<char>& hidden, const Pose& eye);
  void cover(const Visible& visible);
  void noteBehind(const Visible& visible, const Panel& panel);
  void addColumns(const Visible& visible, double from, double to);
  void findCrossings(const std::vector<Panel>& panels);
  void shade(const Background& background, std::uint32_t* rgba, float* depth);

  Optics optics_;
  Sights sights_;

  std::vector<Visible> visible_;
  std::vector<Crossing> around_;      ///< see ColumnPainter::paint
  std::vector<std::size_t> offsets_;  ///< of each column's crossings, and the total
  std::vector<std::size_t> fill_;
  std::vector<Crossing> crossings_;
  ColumnPainter painter_;
  std::vector<Span> spans_;
  std::vector<std::size_t> first_span_, at_span_;
};

}  // namespace kurumaisu
