// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/bodies.h"

#include <limits>
#include <utility>

namespace kurumaisu {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Circle about the middle of the outline's bounding box.
Bodies::Circle enclose(const std::vector<Face>& faces) {
  if (faces.empty()) return {0, 0, 0, 0, 0, -1};
  double left = kInfinity;
  double right = -kInfinity;
  double bottom = kInfinity;
  double top = -kInfinity;
  for (const Face& face : faces) {
    left = std::min({left, face.line.ax, face.line.bx});
    right = std::max({right, face.line.ax, face.line.bx});
    bottom = std::min({bottom, face.line.ay, face.line.by});
    top = std::max({top, face.line.ay, face.line.by});
  }
  const double x = left + (right - left) / 2;
  const double y = bottom + (top - bottom) / 2;
  double radius = 0.0;
  for (const Face& face : faces) {
    radius = std::max({radius, std::hypot(face.line.ax - x, face.line.ay - y),
                       std::hypot(face.line.bx - x, face.line.by - y)});
  }
  constexpr double kSlack = 1e-9;  // share of it, far above the rounding of a turned corner
  return {x, y, radius * (1 + kSlack) + kSlack, 0, 0, -1};
}

}  // namespace

int Bodies::add(std::vector<Face> faces, int tree) {
  const int number = static_cast<int>(bodies_.size());
  Circle circle = enclose(faces);
  Body body{{}, {}, circle.x, circle.y, kInfinity, -kInfinity, {0, 0, 0, 0}, true};
  for (const Face& face : faces) {
    body.z_low = std::min(body.z_low, face.z_low);
    body.z_high = std::max(body.z_high, face.z_high);
  }
  body.placed.resize(faces.size());
  body.faces = std::move(faces);
  const bool wide = circle.radius > kWidest;
  circle.tree = tree;
  circle.cell = wide ? kWide : kGone;
  if (wide) {
    wide_.push_back(number);
  } else {
    widest_ = std::max(widest_, circle.radius);
  }
  bodies_.push_back(std::move(body));
  circles_.push_back(circle);
  place(number, {0, 0, 0, 0});
  return number;
}

void Bodies::remove(int body) {
  leaveCell(body);
  wide_.erase(std::remove(wide_.begin(), wide_.end(), body), wide_.end());
  circles_[static_cast<std::size_t>(body)].cell = kGone;
  Body& gone = bodies_[static_cast<std::size_t>(body)];
  gone.present = false;
  gone.faces = {};
  gone.placed = {};
}

void Bodies::place(int body, const Pose& pose) {
  Body& b = bodies_[static_cast<std::size_t>(body)];
  Circle& circle = circles_[static_cast<std::size_t>(body)];
  b.pose = pose;
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  for (std::size_t i = 0; i < b.faces.size(); ++i) {
    const Segment& line = b.faces[i].line;
    b.placed[i] = {pose.x + c * line.ax - s * line.ay, pose.y + s * line.ax + c * line.ay,
                   pose.x + c * line.bx - s * line.by, pose.y + s * line.bx + c * line.by};
  }
  circle.x = pose.x + c * b.middle_x - s * b.middle_y;
  circle.y = pose.y + s * b.middle_x + c * b.middle_y;
  if (circle.cell == kWide) return;
  const int cell = static_cast<int>(slot(cellOf(circle.x), cellOf(circle.y)));
  if (cell == circle.cell) return;
  leaveCell(body);
  enterCell(body, cell);
}

void Bodies::leaveCell(int body) {
  const Circle& gone = circle(body);
  if (gone.cell < 0) return;
  int* link = &first_[static_cast<std::size_t>(gone.cell)];
  while (*link != body) link = &circles_[static_cast<std::size_t>(*link)].next;
  *link = gone.next;
}

void Bodies::enterCell(int body, int cell) {
  Circle& circle = circles_[static_cast<std::size_t>(body)];
  int& first = first_[static_cast<std::size_t>(cell)];
  circle.cell = cell;
  circle.next = first;
  first = body;
}

}  // namespace kurumaisu
