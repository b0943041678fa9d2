// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/contact.h"

#include <algorithm>
#include <cmath>

namespace kurumaisu {
namespace {

constexpr double kGroundSlack = 1e-9;  // [m] below the ground by rounding only

std::vector<Wall> solidOf(const std::vector<Wall>& walls) {
  std::vector<Wall> solid;
  for (const Wall& wall : walls)
    if (wall.face.solid) solid.push_back(wall);
  return solid;
}

std::vector<Segment> linesOf(const std::vector<Wall>& walls) {
  std::vector<Segment> lines;
  lines.reserve(walls.size());
  for (const Wall& wall : walls) lines.push_back(wall.face.line);
  return lines;
}

/// Twice the area of the triangle a, b, c; positive: c is left of the line from a to b.
double side(double ax, double ay, double bx, double by, double cx, double cy) {
  return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
}

bool apart(double a0, double a1, double b0, double b1) {
  return std::max(a0, a1) < std::min(b0, b1) || std::max(b0, b1) < std::min(a0, a1);
}

/// Whether both ends of q are strictly on one side of p's line.
bool besides(const Segment& p, const Segment& q) {
  const double a = side(p.ax, p.ay, p.bx, p.by, q.ax, q.ay);
  const double b = side(p.ax, p.ay, p.bx, p.by, q.bx, q.by);
  return (a > 0 && b > 0) || (a < 0 && b < 0);
}

/// Whether segments have a point in common.
bool meet(const Segment& p, const Segment& q) {
  if (apart(p.ax, p.bx, q.ax, q.bx) || apart(p.ay, p.by, q.ay, q.by)) return false;
  return !besides(p, q) && !besides(q, p);
}

bool reaches(const Segment& line, const Bodies::Cylinder& around) {
  return !apart(line.ax, line.bx, around.x - around.radius, around.x + around.radius) &&
         !apart(line.ay, line.by, around.y - around.radius, around.y + around.radius);
}

bool facesMeet(const Bodies::Body& one, const Bodies::Body& other, const Bodies::Cylinder& around_it) {
  for (std::size_t i = 0; i < one.faces.size(); ++i) {
    const Face& a = one.faces[i];
    if (!a.solid || !reaches(one.placed[i], around_it)) continue;
    for (std::size_t j = 0; j < other.faces.size(); ++j) {
      const Face& b = other.faces[j];
      if (!b.solid || one.pose.z + a.z_low > other.pose.z + b.z_high ||
          other.pose.z + b.z_low > one.pose.z + a.z_high) {
        continue;
      }
      if (meet(one.placed[i], other.placed[j])) return true;
    }
  }
  return false;
}

bool touchesBody(const Bodies& bodies, int body) {
  const Bodies::Cylinder& around = bodies.cylinder(body);
  bool found = false;
  bodies.near(around.x, around.y, around.radius, [&](int other) {
    if (found || other == body || related(around.tree, bodies.cylinder(other).tree)) return;
    found = facesMeet(bodies[body], bodies[other], bodies.cylinder(other));
  });
  return found;
}

bool inGround(const Bodies::Body& body) {
  return std::any_of(body.faces.begin(), body.faces.end(), [&](const Face& face) {
    return face.solid && body.pose.z + face.z_low < -kGroundSlack;
  });
}

int clampedCell(double position, int count) {
  return static_cast<int>(std::clamp(std::floor(position), 0.0, count - 1.0));
}

}  // namespace

Contact::Contact(const std::vector<Wall>& walls) : walls_(solidOf(walls)), grid_(linesOf(walls_)) {}

bool Contact::touches(const Bodies& bodies, int body) const {
  return inGround(bodies[body]) || touchesWall(bodies, body) || touchesBody(bodies, body);
}

bool Contact::touchesWall(const Bodies& bodies, int body) const {
  const Bodies::Cylinder& around = bodies.cylinder(body);
  if (freeOfWalls(around)) return false;
  const Bodies::Body& b = bodies[body];
  for (std::size_t i = 0; i < b.faces.size(); ++i) {
    const Face& face = b.faces[i];
    if (!face.solid) continue;
    if (touchesWall(b.placed[i], b.pose.z + face.z_low, b.pose.z + face.z_high, around.tree)) return true;
  }
  return false;
}

// Cells that are nearer to the middle's cell than its clearance are empty. Seen from outside the grid, the nearest
// point of the grid is nearer to every wall.
bool Contact::freeOfWalls(const Bodies::Cylinder& around) const {
  if (walls_.empty()) return true;
  const int column = clampedCell((around.x - grid_.left()) / grid_.cell(), grid_.width());
  const int row = clampedCell((around.y - grid_.bottom()) / grid_.cell(), grid_.height());
  return (grid_.clearance(grid_.index(column, row)) - 1) * grid_.cell() > around.radius;
}

bool Contact::touchesWall(const Segment& line, double low, double high, int tree) const {
  constexpr double kMargin = 1e-6;  // of a cell's edge, as in the grid
  const auto columnOf = [&](double x) { return (x - grid_.left()) / grid_.cell(); };
  const auto rowOf = [&](double y) { return (y - grid_.bottom()) / grid_.cell(); };
  const int left = clampedCell(columnOf(std::min(line.ax, line.bx)) - kMargin, grid_.width());
  const int right = clampedCell(columnOf(std::max(line.ax, line.bx)) + kMargin, grid_.width());
  const int bottom = clampedCell(rowOf(std::min(line.ay, line.by)) - kMargin, grid_.height());
  const int top = clampedCell(rowOf(std::max(line.ay, line.by)) + kMargin, grid_.height());
  for (int row = bottom; row <= top; ++row) {
    int column = left;
    while (column <= right) {
      const std::size_t cell = grid_.index(column, row);
      if (inCell(cell, line, low, high, tree)) return true;
      column += std::max(1, grid_.clearance(cell));
    }
  }
  return false;
}

bool Contact::inCell(std::size_t cell, const Segment& line, double low, double high, int tree) const {
  return std::any_of(grid_.begin(cell), grid_.end(cell), [&](std::int32_t i) {
    const Wall& wall = walls_[static_cast<std::size_t>(i)];
    return wall.face.z_low <= high && low <= wall.face.z_high && !related(wall.tree, tree) &&
           meet(line, wall.face.line);
  });
}

}  // namespace kurumaisu
