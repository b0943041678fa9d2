// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/camera.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace kurumaisu {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr float kFarAway = std::numeric_limits<float>::infinity();

/// A number in [-2, 2] that grows with the angle of (x, y) in [-pi, pi], without trigonometry.
double turn(double x, double y) {
  constexpr double kTiny = 1e-300;  // [m] keeps the eye itself from dividing by zero
  const double part = y / (std::fabs(x) + std::fabs(y) + kTiny);
  if (x >= 0) return part;
  return y >= 0 ? 2 - part : -2 - part;
}

}  // namespace

void validate(const Optics& o) {
  constexpr int kMost = 8192;
  if (o.width < 1 || o.width > kMost || o.height < 1 || o.height > kMost)
    throw std::invalid_argument("width and height must be 1 to 8192 pixels");
  if (!(o.fov_h > 0 && o.fov_h < kPi && o.fov_v > 0 && o.fov_v < kPi))
    throw std::invalid_argument("fields of view must be above 0 and below pi");
  if (!(o.near >= 0 && o.far > o.near && std::isfinite(o.far)))
    throw std::invalid_argument("near and far must be 0 <= near < far, finite");
  if (!(std::fabs(o.tilt) <= kPi / 2)) throw std::invalid_argument("tilt must be within +-pi / 2");
}

Camera::Camera(const Optics& optics) : optics_(optics) {
  validate(optics);
  sights_.resize(static_cast<std::size_t>(optics.width) * static_cast<std::size_t>(optics.height));
  if (optics.tilt == 0) {
    lookAhead();
  } else {
    lookDown();
  }
  float most = 0;
  for (const Sight& sight : sights_) most = std::max(most, 1.0F / sight.scale);
  reach_ = optics.far * static_cast<double>(most) * (1 + 1e-6);
}

/// Without tilt, the columns of the picture are the half-planes.
void Camera::lookAhead() {
  const double fx = optics_.width / (2 * std::tan(optics_.fov_h / 2));
  const double fy = optics_.height / (2 * std::tan(optics_.fov_v / 2));
  const int w = optics_.width;
  std::vector<double> azimuths(static_cast<std::size_t>(w));
  for (int u = 0; u < w; ++u) {
    const double right = (u + 0.5 - w / 2.0) / fx;
    const double level = std::hypot(1.0, right);
    azimuths[static_cast<std::size_t>(w - 1 - u)] = std::atan(-right);
    for (int v = 0; v < optics_.height; ++v) {
      const double down = (v + 0.5 - optics_.height / 2.0) / fy;
      sights_[static_cast<std::size_t>(v) * static_cast<std::size_t>(w) + static_cast<std::size_t>(u)] = {
          w - 1 - u, static_cast<float>(-down / level), static_cast<float>(1 / level)};
    }
  }
  setColumns(azimuths);
}

void Camera::lookDown() {
  const double fx = optics_.width / (2 * std::tan(optics_.fov_h / 2));
  const double fy = optics_.height / (2 * std::tan(optics_.fov_v / 2));
  const double c = std::cos(optics_.tilt);
  const double s = std::sin(optics_.tilt);
  std::vector<double> angles(sights_.size());
  std::size_t i = 0;
  for (int v = 0; v < optics_.height; ++v) {
    const double down = (v + 0.5 - optics_.height / 2.0) / fy;
    for (int u = 0; u < optics_.width; ++u, ++i) {
      const double right = (u + 0.5 - optics_.width / 2.0) / fx;
      const double ahead = c - down * s;
      constexpr double kSteep = 1e-6;  // straight up and down have no azimuth
      const double level = std::max(std::hypot(ahead, right), kSteep);
      angles[i] = std::atan2(-right, ahead);
      sights_[i] = {0, static_cast<float>((-s - down * c) / level), static_cast<float>(1 / level)};
    }
  }
  const auto [low, high] = std::minmax_element(angles.begin(), angles.end());
  const double width = std::max(*high - *low, 1e-9);
  const int n = std::clamp(static_cast<int>(kFiner * width * fx), 2, 2 * kFiner * optics_.width);
  std::vector<double> azimuths(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) azimuths[static_cast<std::size_t>(k)] = *low + width * k / (n - 1);
  for (i = 0; i < sights_.size(); ++i)
    sights_[i].column = static_cast<std::int32_t>(std::lround((angles[i] - *low) / width * (n - 1)));
  setColumns(azimuths);
}

void Camera::setColumns(const std::vector<double>& azimuths) {
  for (const double azimuth : azimuths) {
    dx_.push_back(std::cos(azimuth));
    dy_.push_back(std::sin(azimuth));
    order_.push_back(turn(dx_.back(), dy_.back()));
  }
}

void Camera::render(const std::vector<Panel>& panels, const std::vector<Stand>& stands,
                    const std::vector<char>& hidden, const Stand& eye, const Background& background,
                    std::uint32_t* rgba, float* depth) {
  std::vector<double> cosines, sines;
  for (const Stand& stand : stands) {
    cosines.push_back(std::cos(stand.heading - eye.heading));
    sines.push_back(std::sin(stand.heading - eye.heading));
  }
  const double c = std::cos(eye.heading);
  const double s = std::sin(eye.heading);
  visible_.clear();
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const Panel& p = panels[i];
    const auto body = static_cast<std::size_t>(p.body);
    if (hidden[body]) continue;
    const Stand& at = stands[body];
    const double x = c * (at.x - eye.x) + s * (at.y - eye.y);
    const double y = -s * (at.x - eye.x) + c * (at.y - eye.y);
    const double cb = cosines[body];
    const double sb = sines[body];
    cover({static_cast<std::int32_t>(i), 0, 0, x + cb * p.ax - sb * p.ay, y + sb * p.ax + cb * p.ay,
           x + cb * p.bx - sb * p.by, y + sb * p.bx + cb * p.by, at.z - eye.z});
  }
  findCrossings(panels);
  spans_.clear();
  first_span_.clear();
  for (std::size_t k = 0; k < order_.size(); ++k) {
    Crossing* from = crossings_.data() + offsets_[k];
    Crossing* to = crossings_.data() + offsets_[k + 1];
    std::stable_sort(from, to, [](const Crossing& a, const Crossing& b) { return a.distance < b.distance; });
    first_span_.push_back(spans_.size());
    painter_.paint(from, static_cast<std::size_t>(to - from), eye.z, background, spans_);
  }
  shade(background, rgba, depth);
}

/// Notes which columns a panel is seen in.
void Camera::cover(Visible v) {
  if (std::min(v.ax, v.bx) > reach_ || std::max(v.ax, v.bx) < -reach_) return;
  if (std::min(v.ay, v.by) > reach_ || std::max(v.ay, v.by) < -reach_) return;
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
  const auto begin = order_.begin();
  v.first = static_cast<std::int32_t>(std::lower_bound(begin, order_.end(), from) - begin);
  v.last = static_cast<std::int32_t>(std::lower_bound(begin + v.first, order_.end(), to) - begin);
  if (v.first < v.last) visible_.push_back(v);
}

/// Sorts what is seen into the columns.
void Camera::findCrossings(const std::vector<Panel>& panels) {
  offsets_.assign(order_.size() + 1, 0);
  for (const Visible& v : visible_) {
    for (std::int32_t k = v.first; k < v.last; ++k) ++offsets_[static_cast<std::size_t>(k) + 1];
  }
  for (std::size_t k = 0; k < order_.size(); ++k) offsets_[k + 1] += offsets_[k];
  crossings_.resize(offsets_.back());
  fill_.assign(offsets_.begin(), offsets_.end() - 1);
  for (const Visible& v : visible_) {
    const Panel& p = panels[static_cast<std::size_t>(v.panel)];
    const double ex = v.bx - v.ax;
    const double ey = v.by - v.ay;
    const double moment = v.ax * ey - v.ay * ex;
    for (auto k = static_cast<std::size_t>(v.first); k < static_cast<std::size_t>(v.last); ++k) {
      const double across = dx_[k] * ey - dy_[k] * ex;
      // The inside is to the left of a counter-clockwise outline.
      crossings_[fill_[k]++] = {
          std::fmax(moment / across, 0.0), p.low + v.up, p.high + v.up, p.color, p.prism, across < 0};
    }
  }
}

/// Row by row: each column remembers the span it has come down to.
void Camera::shade(const Background& background, std::uint32_t* rgba, float* depth) {
  at_span_ = first_span_;
  const auto near = static_cast<float>(optics_.near);
  const auto far = static_cast<float>(optics_.far);
  for (std::size_t i = 0; i < sights_.size(); ++i) {
    const Sight sight = sights_[i];
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
