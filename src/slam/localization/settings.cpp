// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/settings.h"

namespace kurumaisu {
namespace {

template <typename Visit>
void visitReading(ReadingSettings& s, Visit&& visit) {
  visit("laser_max_beams", s.max_beams, 4, 10000);
  visit("laser_max_range", s.max_range, 0.1, 1000);
  visit("laser_correlation", s.correlation, 0, 0.99);
  visit("laser_sigma_hit", s.sigma_hit, 1e-3, 10);
  visit("laser_z_hit", s.z_hit, 0.01, 1);
  visit("laser_z_rand", s.z_rand, 1e-3, 1);
  visit("laser_likelihood_max_dist", s.max_distance, 0.05, 10);
  visit("laser_power", s.power, 1e-3, 10);
}

template <typename Visit>
void visitMotion(MotionSettings& s, Visit&& visit) {
  visit("odom_alpha1", s.alpha1, 0, 100);
  visit("odom_alpha2", s.alpha2, 0, 100);
  visit("odom_alpha3", s.alpha3, 0, 100);
  visit("odom_alpha4", s.alpha4, 0, 100);
  visit("odom_way_floor", s.way_floor, 1e-6, 10);
  visit("odom_turn_floor", s.turn_floor, 1e-6, 10);
}

template <typename Visit>
void visitRecovery(RecoverySettings& s, Visit&& visit) {
  visit("recovery_alpha_slow", s.alpha_slow, 1e-6, 1);
  visit("recovery_alpha_fast", s.alpha_fast, 1e-6, 1);
  visit("lost_fit", s.lost_fit, 0, 1);
  visit("lost_drop", s.lost_drop, 0, 1);
  visit("found_fit", s.found_fit, 0, 1);
  visit("found_odds", s.found_odds, 1, 1e12);
  visit("found_way", s.found_way, 0, 100);
  visit("search_power", s.power, 1e-3, 10);
  visit("search_step", s.step, 0.02, 10);
  visit("search_angle_step", s.angle_step, 0.01, 1.6);
  visit("search_positions_per_scan", s.positions_per_scan, 1, 1e8);
  visit("search_places", s.places, 1, 1e6);
}

template <typename Visit>
void visitSettings(LocalizerSettings& s, Visit&& visit) {
  visit("min_particles", s.min_particles, 1, 1e6);
  visit("max_particles", s.max_particles, 1, 1e6);
  visit("kld_err", s.kld_err, 1e-3, 1);
  visit("kld_z", s.kld_z, 0, 10);
  visit("update_min_d", s.update_min_d, 0, 100);
  visit("update_min_a", s.update_min_a, 0, 10);
  visit("ambiguous_spread", s.ambiguous_spread, 1e-3, 100);
  visitReading(s.reading, visit);
  visitMotion(s.motion, visit);
  visitRecovery(s.recovery, visit);
}

/// visitSettings() as a value that templates take.
constexpr auto kVisitLocalizer = [](LocalizerSettings& settings, auto&& visit) {
  visitSettings(settings, visit);
};

}  // namespace

std::vector<std::string> localizerSettingNames() { return namesOf<LocalizerSettings>(kVisitLocalizer); }

LocalizerSettings makeLocalizerSettings(const ValueOf& value_of) {
  const auto settings = made<LocalizerSettings>(kVisitLocalizer, value_of);
  if (settings.max_particles < settings.min_particles) {
    throw std::invalid_argument("max_particles: must be at least min_particles: " +
                                std::to_string(settings.max_particles));
  }
  return settings;
}

}  // namespace kurumaisu
