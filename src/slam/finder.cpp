// SPDX-License-Identifier: BSD-3-Clause
#include "slam/finder.h"

namespace kurumaisu {
namespace {

constexpr double kHeadStart = 5;  // log-odds of the place where the chair was believed to be, when doubted

}  // namespace

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
  found.add(search_->poses(), beams_, 0);
  if (doubted_) found.add({*doubted_}, beams_, kHeadStart);
  search_.reset();
  found.update(motionBetween(begun_, now, settings_->motion, process_), beams);
  return found;
}

}  // namespace kurumaisu
