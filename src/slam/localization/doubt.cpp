// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/doubt.h"

#include <cmath>

namespace kurumaisu {
namespace {

constexpr int kPatience = 8;        // scans before a new pose is doubted, or one that was widened is given up
constexpr double kSearchAfter = 3;  // times found_way after which a doubt that does not end leads to a search
// A doubted pose is believed again when its fit is as usual but for this: from the wrong corridor nine of ten
// readings are explained too.
constexpr double kLessThanUsual = 0.03;

}  // namespace

void Health::take(double fit, const RecoverySettings& settings) {
  ++scans;
  fast += std::fmax(settings.alpha_fast, 1.0 / scans) * (fit - fast);
  slow += std::fmax(settings.alpha_slow, 1.0 / scans) * (fit - slow);
}

bool Health::doubtful(const RecoverySettings& settings) const {
  return scans > kPatience && (fast < settings.lost_fit || fast < settings.lost_drop * slow);
}

Doubt::Step Doubt::judge(const Health& health, double travelled) {
  const bool doubtful = health.doubtful(*settings_);
  if (!standing()) {
    if (!doubtful) return Step::kNone;
    scans_ = 1;
    restored_ = std::fmax(settings_->found_fit, health.slow - kLessThanUsual);
    return Step::kWiden;
  }
  ++scans_;
  if (travelled >= settings_->found_way && health.fast >= restored_) {
    clear();
    return Step::kNone;
  }
  const bool unsettled = travelled >= kSearchAfter * settings_->found_way;
  return unsettled || (doubtful && scans_ > kPatience) ? Step::kSearch : Step::kNone;
}

}  // namespace kurumaisu
