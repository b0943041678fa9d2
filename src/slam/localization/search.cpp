// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

constexpr std::size_t kBeams = 40;  // tried at every pose
constexpr std::size_t kSpare = 8;   // candidates kept for every place: most are neighbours
constexpr int kSkip = 64;           // positions that are not free cost about a 64th of one that is

static_assert(kBeams * Field::kFar <= std::numeric_limits<std::uint16_t>::max());

}  // namespace

std::vector<std::vector<Search::Offset>> Search::rotated(const Beams& beams, double step, double resolution) {
  const int headings = static_cast<int>(std::ceil(2 * M_PI / step));
  const std::size_t every = std::max<std::size_t>(1, (beams.beams.size() + kBeams - 1) / kBeams);
  std::vector<std::vector<Offset>> out(headings);
  for (int heading = 0; heading < headings; ++heading) {
    const double angle = 2 * M_PI * heading / headings;
    const double c = std::cos(angle) / resolution;
    const double s = std::sin(angle) / resolution;
    for (std::size_t i = 0; i < beams.beams.size(); i += every) {
      const Beam& beam = beams.beams[i];
      // Base is in the middle of a cell.
      out[heading].push_back({static_cast<int>(std::floor(0.5 + c * beam.x - s * beam.y)),
                              static_cast<int>(std::floor(0.5 + s * beam.x + c * beam.y))});
    }
  }
  return out;
}

int Search::farthest(const std::vector<std::vector<Offset>>& rotated) {
  int out = 0;
  for (const auto& offsets : rotated) {
    for (const Offset& offset : offsets) out = std::max({out, std::abs(offset.x), std::abs(offset.y)});
  }
  return out;
}

Search::Search(const Sensor& sensor, const RecoverySettings& settings, const Beams& beams)
    : sensor_(&sensor),
      settings_(&settings),
      rotated_(rotated(beams, settings.angle_step, sensor.field().resolution())),
      stride_(std::max(1, static_cast<int>(std::lround(settings.step / sensor.field().resolution())))),
      left_(std::min(stride_ / 2, sensor.field().width() - 1)),
      low_(std::min(stride_ / 2, sensor.field().height() - 1)),
      columns_((sensor.field().width() - 1 - left_) / stride_ + 1),
      rows_((sensor.field().height() - 1 - low_) / stride_ + 1),
      reach_(farthest(rotated_)),
      codes_(sensor.field(), stride_, reach_) {}

bool Search::step() {
  const Field& field = sensor_->field();
  const int end = columns_ * rows_;
  for (long budget = static_cast<long>(settings_->positions_per_scan) * kSkip; budget > 0 && next_ < end;) {
    int run = 0;
    const int left = columns_ - next_ % columns_;
    for (; run < left && budget > 0 && field.free(columnAt(next_ + run), rowAt(next_)); ++run) {
      budget -= kSkip + 1;
    }
    if (run > 0) tryRun(next_, run);
    if (run == 0) --budget;
    next_ += std::max(run, 1);
  }
  return next_ >= end;
}

double Search::progress() const { return next_ / (static_cast<double>(columns_) * rows_); }

void Search::tryRun(int position, int count) {
  const int x = columnAt(position);
  const int y = rowAt(position);
  const int headings = static_cast<int>(rotated_.size());
  codes_.forgetBelow(y - reach_);
  misfits_.assign(static_cast<std::size_t>(headings) * count, 0);
  const auto misfits = [&](int heading) { return &misfits_[static_cast<std::size_t>(heading) * count]; };
  for (int heading = 0; heading < headings; ++heading) {
    std::uint16_t* sums = misfits(heading);
    for (const Offset& offset : rotated_[heading]) {
      const std::uint8_t* codes = codes_.at(x + offset.x, y + offset.y);
      for (int i = 0; i < count; ++i) sums[i] = static_cast<std::uint16_t>(sums[i] + codes[i]);
    }
  }
  for (int i = 0; i < count; ++i) {
    for (int heading = 0; heading < headings; ++heading) {
      const int misfit = misfits(heading)[i];
      const int before = misfits((heading + headings - 1) % headings)[i];
      const int after = misfits((heading + 1) % headings)[i];
      if (misfit <= before && misfit < after) keep({misfit, x + i * stride_, y, heading});
    }
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
