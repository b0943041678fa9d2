// SPDX-License-Identifier: BSD-3-Clause
#include "slam/search.h"

#include <algorithm>
#include <cmath>

#include "slam/pose.h"

namespace kurumaisu {
namespace {

constexpr std::size_t kBeams = 40;  // tried at every pose
constexpr std::size_t kSpare = 8;   // candidates kept for every place: most are neighbours
constexpr int kSkip = 64;           // positions that are not free cost about a 64th of one that is

}  // namespace

Search::Search(const Sensor& sensor, const RecoverySettings& settings, Beams beams)
    : sensor_(&sensor), settings_(&settings) {
  const Field& field = sensor.field();
  stride_ = std::max(1, static_cast<int>(std::lround(settings.step / field.resolution())));
  columns_ = (field.width() + stride_ - 1) / stride_;
  rows_ = (field.height() + stride_ - 1) / stride_;
  const int headings = static_cast<int>(std::ceil(2 * M_PI / settings.angle_step));
  const std::size_t every = std::max<std::size_t>(1, (beams.beams.size() + kBeams - 1) / kBeams);
  for (int heading = 0; heading < headings; ++heading) {
    const double angle = 2 * M_PI * heading / headings;
    const double c = std::cos(angle) / field.resolution();
    const double s = std::sin(angle) / field.resolution();
    std::vector<Offset> offsets;
    for (std::size_t i = 0; i < beams.beams.size(); i += every) {
      const Beam& beam = beams.beams[i];
      offsets.push_back(
          {static_cast<float>(c * beam.x - s * beam.y), static_cast<float>(s * beam.x + c * beam.y)});
    }
    rotated_.push_back(std::move(offsets));
  }
}

bool Search::step() {
  const Field& field = sensor_->field();
  for (long budget = static_cast<long>(settings_->positions_per_scan) * kSkip; budget > 0;
       --budget, ++next_) {
    if (next_ >= columns_ * rows_) return true;
    const int x = std::min(next_ % columns_ * stride_ + stride_ / 2, field.width() - 1);
    const int y = std::min(next_ / columns_ * stride_ + stride_ / 2, field.height() - 1);
    if (!field.free(x, y)) continue;
    tryPosition(x, y);
    budget -= kSkip;
  }
  return next_ >= columns_ * rows_;
}

double Search::progress() const { return next_ / (static_cast<double>(columns_) * rows_); }

void Search::tryPosition(int x, int y) {
  const Field& field = sensor_->field();
  const int headings = static_cast<int>(rotated_.size());
  std::vector<int> misfits(headings);
  for (int heading = 0; heading < headings; ++heading) {
    int sum = 0;
    for (const Offset& offset : rotated_[heading]) {
      sum += field.code(static_cast<float>(x) + 0.5F + offset.x, static_cast<float>(y) + 0.5F + offset.y);
    }
    misfits[heading] = sum;
  }
  for (int heading = 0; heading < headings; ++heading) {
    const int before = misfits[(heading + headings - 1) % headings];
    const int after = misfits[(heading + 1) % headings];
    if (misfits[heading] <= before && misfits[heading] < after) keep({misfits[heading], x, y, heading});
  }
}

void Search::keep(const Candidate& candidate) {
  const auto better = [](const Candidate& a, const Candidate& b) { return a.misfit < b.misfit; };
  if (kept_.size() >= kSpare * settings_->places) {
    if (!better(candidate, kept_.front())) return;
    std::pop_heap(kept_.begin(), kept_.end(), better);
    kept_.pop_back();
  }
  kept_.push_back(candidate);
  std::push_heap(kept_.begin(), kept_.end(), better);
}

Pose2D Search::poseOf(const Candidate& candidate) const {
  const Field& field = sensor_->field();
  const double angle = 2 * M_PI * candidate.heading / static_cast<double>(rotated_.size());
  return compose(field.mapFromGrid(),
                 {(candidate.x + 0.5) * field.resolution(), (candidate.y + 0.5) * field.resolution(), angle});
}

std::vector<Pose2D> Search::poses() const {
  std::vector<Candidate> sorted = kept_;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Candidate& a, const Candidate& b) { return a.misfit < b.misfit; });
  std::vector<Pose2D> out;
  for (const Candidate& candidate : sorted) {
    if (out.size() >= static_cast<std::size_t>(settings_->places)) break;
    const Pose2D pose = poseOf(candidate);
    const bool is_new = std::none_of(out.begin(), out.end(), [&](const Pose2D& other) {
      return std::hypot(pose.x - other.x, pose.y - other.y) < 1.6 * settings_->step &&
             std::abs(wrapAngle(pose.theta - other.theta)) < 1.6 * settings_->angle_step;
    });
    if (is_new) out.push_back(pose);
  }
  return out;
}

}  // namespace kurumaisu
