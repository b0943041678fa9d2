// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/bodies.h"

#include <utility>

#include "raycast/infinity.h"

namespace kurumaisu {
namespace {

/// About the middle of the outline's bounding box.
Bodies::Cylinder enclose(const std::vector<Face>& faces) {
  double left = kInfinity;
  double right = -kInfinity;
  double bottom = kInfinity;
  double top = -kInfinity;
  Bodies::Cylinder out{0, 0, 0, kInfinity, -kInfinity, 0, 0, -1};
  if (faces.empty()) return out;
  for (const Face& face : faces) {
    left = std::min({left, face.line.ax, face.line.bx});
    right = std::max({right, face.line.ax, face.line.bx});
    bottom = std::min({bottom, face.line.ay, face.line.by});
    top = std::max({top, face.line.ay, face.line.by});
    out.z_low = std::min(out.z_low, face.z_low);
    out.z_high = std::max(out.z_high, face.z_high);
  }
  out.x = left + (right - left) / 2;
  out.y = bottom + (top - bottom) / 2;
  for (const Face& face : faces) {
    out.radius = std::max({out.radius, std::hypot(face.line.ax - out.x, face.line.ay - out.y),
                           std::hypot(face.line.bx - out.x, face.line.by - out.y)});
  }
  constexpr double kSlack = 1e-9;  // share of it, and [m]: far above the rounding of a turned corner
  out.radius += kSlack * (1 + out.radius);
  return out;
}

}  // namespace

int Bodies::add(std::vector<Face> faces, int tree) {
  const int number = static_cast<int>(bodies_.size());
  Cylinder around = enclose(faces);
  Body body{{}, {}, around.x, around.y, around.z_low, around.z_high, {0, 0, 0, 0}, true};
  body.placed.resize(faces.size());
  body.faces = std::move(faces);
  const bool wide = around.radius > kWidest;
  around.tree = tree;
  around.cell = wide ? kWide : kGone;
  if (wide) {
    wide_.push_back(number);
  } else {
    widest_ = std::max(widest_, around.radius);
  }
  bodies_.push_back(std::move(body));
  cylinders_.push_back(around);
  place(number, {0, 0, 0, 0});
  return number;
}

void Bodies::remove(int body) {
  leaveCell(body);
  wide_.erase(std::remove(wide_.begin(), wide_.end(), body), wide_.end());
  cylinders_[static_cast<std::size_t>(body)].cell = kGone;
  Body& gone = bodies_[static_cast<std::size_t>(body)];
  gone.present = false;
  gone.faces = {};
  gone.placed = {};
}

void Bodies::place(int body, const Pose& pose) {
  Body& b = bodies_[static_cast<std::size_t>(body)];
  Cylinder& around = cylinders_[static_cast<std::size_t>(body)];
  b.pose = pose;
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  for (std::size_t i = 0; i < b.faces.size(); ++i) {
    const Segment& line = b.faces[i].line;
    b.placed[i] = {pose.x + c * line.ax - s * line.ay, pose.y + s * line.ax + c * line.ay,
                   pose.x + c * line.bx - s * line.by, pose.y + s * line.bx + c * line.by};
  }
  around.x = pose.x + c * b.middle_x - s * b.middle_y;
  around.y = pose.y + s * b.middle_x + c * b.middle_y;
  around.z_low = pose.z + b.z_low;
  around.z_high = pose.z + b.z_high;
  if (around.cell == kWide) return;
  const int cell = static_cast<int>(slot(cellOf(around.x), cellOf(around.y)));
  if (cell == around.cell) return;
  leaveCell(body);
  enterCell(body, cell);
}

void Bodies::leaveCell(int body) {
  const Cylinder& gone = cylinder(body);
  if (gone.cell < 0) return;
  int* link = &first_[static_cast<std::size_t>(gone.cell)];
  while (*link != body) link = &cylinders_[static_cast<std::size_t>(*link)].next;
  *link = gone.next;
}

void Bodies::enterCell(int body, int cell) {
  Cylinder& around = cylinders_[static_cast<std::size_t>(body)];
  int& first = first_[static_cast<std::size_t>(cell)];
  around.cell = cell;
  around.next = first;
  first = body;
}

}  // namespace kurumaisu
