// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/camera/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kurumaisu {
namespace {

constexpr float kFarAway = std::numeric_limits<float>::infinity();

}  // namespace

Camera::Camera(const Optics& optics) : optics_(optics), sights_(makeSights(optics)) {}

void Camera::render(const std::vector<Panel>& panels, const std::vector<Pose>& poses,
                    const std::vector<char>& hidden, const Pose& eye, const Background& background,
                    std::uint32_t* rgba, float* depth) {
  place(panels, poses, hidden, eye);
  findCrossings(panels);
  spans_.clear();
  first_span_.clear();
  for (std::size_t k = 0; k < sights_.columns.size(); ++k) {
    Crossing* from = crossings_.data() + offsets_[k];
    Crossing* to = crossings_.data() + offsets_[k + 1];
    std::stable_sort(from, to, [](const Crossing& a, const Crossing& b) { return a.distance < b.distance; });
    first_span_.push_back(spans_.size());
    painter_.paint(around_, from, static_cast<std::size_t>(to - from), eye.z, background, spans_);
  }
  shade(background, rgba, depth);
}

/// Moves all panels into the frame of the eye and keeps those that it may see.
void Camera::place(const std::vector<Panel>& panels, const std::vector<Pose>& poses,
                   const std::vector<char>& hidden, const Pose& eye) {
  std::vector<double> cosines, sines;
  for (const Pose& pose : poses) {
    cosines.push_back(std::cos(pose.heading - eye.heading));
    sines.push_back(std::sin(pose.heading - eye.heading));
  }
  const double c = std::cos(eye.heading);
  const double s = std::sin(eye.heading);
  visible_.clear();
  around_.clear();
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const Panel& p = panels[i];
    const auto body = static_cast<std::size_t>(p.body);
    if (hidden[body]) continue;
    const Pose& at = poses[body];
    const double x = c * (at.x - eye.x) + s * (at.y - eye.y);
    const double y = -s * (at.x - eye.x) + c * (at.y - eye.y);
    const double cb = cosines[body];
    const double sb = sines[body];
    const Visible v{static_cast<std::int32_t>(i),
                    0,
                    0,
                    x + cb * p.ax - sb * p.ay,
                    y + sb * p.ax + cb * p.ay,
                    x + cb * p.bx - sb * p.by,
                    y + sb * p.bx + cb * p.by,
                    at.z - eye.z};
    noteBehind(v, p);
    cover(v);
  }
}

/// Finds the prisms around the eye: those whose outline crosses the half-line behind it an odd number of times.
void Camera::noteBehind(const Visible& v, const Panel& p) {
  if (p.prism < 0 || (v.ay < 0) == (v.by < 0)) return;
  if (v.ax - v.ay * (v.bx - v.ax) / (v.by - v.ay) >= 0) return;
  const auto same = [&](const Crossing& wall) { return wall.prism == p.prism; };
  const auto found = std::find_if(around_.begin(), around_.end(), same);
  if (found == around_.end()) {
    around_.push_back({0.0, p.low + v.up, p.high + v.up, p.color, p.prism});
  } else {
    around_.erase(found);
  }
}

/// Notes which columns a panel is seen in.
void Camera::cover(const Visible& v) {
  if (std::min(v.ax, v.bx) > sights_.reach || std::max(v.ax, v.bx) < -sights_.reach) return;
  if (std::min(v.ay, v.by) > sights_.reach || std::max(v.ay, v.by) < -sights_.reach) return;
  const double a = turn(v.ax, v.ay);
  const double b = turn(v.bx, v.by);
  const bool left_to_right = v.ax * v.by - v.ay * v.bx < 0;  // clockwise, seen from the eye
  const double from = left_to_right ? b : a;
  const double to = left_to_right ? a : b;
  if (from <= to) {
    addColumns(v, from, to);
  } else {  // it passes behind the eye
    addColumns(v, from, 3.0);
    addColumns(v, -3.0, to);
  }
}

void Camera::addColumns(const Visible& visible, double from, double to) {
  Visible v = visible;
  const auto& columns = sights_.columns;
  const auto before = [](const Sights::Column& column, double at) { return column.turn < at; };
  const auto begin = columns.begin();
  v.first = static_cast<std::int32_t>(std::lower_bound(begin, columns.end(), from, before) - begin);
  v.last = static_cast<std::int32_t>(std::lower_bound(begin + v.first, columns.end(), to, before) - begin);
  if (v.first < v.last) visible_.push_back(v);
}

/// Sorts what is seen into the columns.
void Camera::findCrossings(const std::vector<Panel>& panels) {
  offsets_.assign(sights_.columns.size() + 1, 0);
  for (const Visible& v : visible_) {
    for (std::int32_t k = v.first; k < v.last; ++k) ++offsets_[static_cast<std::size_t>(k) + 1];
  }
  for (std::size_t k = 0; k < sights_.columns.size(); ++k) offsets_[k + 1] += offsets_[k];
  crossings_.resize(offsets_.back());
  fill_.assign(offsets_.begin(), offsets_.end() - 1);
  for (const Visible& v : visible_) {
    const Panel& p = panels[static_cast<std::size_t>(v.panel)];
    const double ex = v.bx - v.ax;
    const double ey = v.by - v.ay;
    const double moment = v.ax * ey - v.ay * ex;
    for (auto k = static_cast<std::size_t>(v.first); k < static_cast<std::size_t>(v.last); ++k) {
      const Sights::Column& column = sights_.columns[k];
      const double across = column.dx * ey - column.dy * ex;
      crossings_[fill_[k]++] = {std::fmax(moment / across, 0.0), p.low + v.up, p.high + v.up, p.color,
                                p.prism};
    }
  }
}

/// Row by row: each column remembers the span it has come down to.
void Camera::shade(const Background& background, std::uint32_t* rgba, float* depth) {
  at_span_ = first_span_;
  const auto near = static_cast<float>(optics_.near);
  const auto far = static_cast<float>(optics_.far);
  for (std::size_t i = 0; i < sights_.pixels.size(); ++i) {
    const Sights::Sight sight = sights_.pixels[i];
    const auto column = static_cast<std::size_t>(sight.column);
    std::size_t at = at_span_[column];
    while (sight.slope < spans_[at].low) ++at;
    while (at > first_span_[column] && sight.slope >= spans_[at - 1].low) --at;
    at_span_[column] = at;
    const float z = spans_[at].along(sight.slope) * sight.scale;
    rgba[i] = z < far ? spans_[at].color : background.sky;
    depth[i] = !(z < far) ? kFarAway : z <= near ? -kFarAway : z;
  }
}

}  // namespace kurumaisu
