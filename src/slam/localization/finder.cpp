// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/finder.h"

namespace kurumaisu {
std::optional<Places> Finder::step(const Beams& beams, const Odometry& now,
                                   const std::optional<Pose2D>& doubted) {
  if (!search_) {
    if (beams.beams.size() < kLeastReadings) return std::nullopt;
    search_.emplace(*sensor_, settings_->recovery, beams);
    beams_ = beams;
    begun_ = now;
    doubted_ = doubted;
  }
  if (!search_->step()) return std::nullopt;
  Places found(*sensor_, settings_->recovery);
  found.add(search_->poses(), beams_);
  // Where a map has no place at all, it does not speak for that one either.
  if (doubted_ && !found.empty()) found.addDoubted(*doubted_, beams_);
  search_.reset();
  found.update(motionBetween(begun_, now, settings_->motion, process_), beams);
  return found;
}

}  // namespace kurumaisu
