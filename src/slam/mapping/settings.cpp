// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/settings.h"

namespace kurumaisu {
namespace {

/// Calls visit(name, member, lower bound, upper bound) for every setting.
template <typename Visit>
void visitSettings(MapperSettings& s, Visit&& visit) {
  visit("match_iterations", s.match.iterations, 1, 100);
  visit("match_every", s.match.every, 1, 100);
  visit("match_reach", s.match.reach, 0.01, 10);
  visit("match_deviation", s.match.deviation, 1e-3, 1);
  visit("match_key_distance", s.match.key_distance, 0, 100);
  visit("match_key_angle", s.match.key_angle, 0, 10);
  visit("match_key_scans", s.match.key_scans, 1, 1000);
  visit("match_prior_distance", s.match.prior_distance, 0, 10);
  visit("match_prior_angle", s.match.prior_angle, 0, 10);
  visit("match_prior_floor", s.match.prior_floor, 1e-6, 10);
  visit("match_prior_angle_floor", s.match.prior_angle_floor, 1e-6, 10);
  visit("jump_speed", s.jump_speed, 0.1, 1000);
  visit("jump_turn", s.jump_turn, 0.1, 1000);
  visit("slip_gain", s.slip_gain, 0, 1);
  visit("resolution", s.resolution, 0.005, 1);
  visit("range", s.range, 0.1, 200);
  visit("dropout_beams", s.dropout_beams, 0, 1000);
  visit("certainty", s.certainty, 0.51, 0.99);
  visit("most_cells", s.most_cells, 1e4, 1e9);
  visit("particles", s.particles, 1, 10000);
  visit("localise_distance", s.localise_distance, 0, 100);
  visit("localise_angle", s.localise_angle, 0, 10);
  visit("localise_time", s.localise_time, 0, 1e6);
  visit("insert_distance", s.insert_distance, 0, 100);
  visit("insert_angle", s.insert_angle, 0, 10);
  visit("distance_per_distance", s.distance_per_distance, 0, 10);
  visit("distance_per_angle", s.distance_per_angle, 0, 10);
  visit("angle_per_distance", s.angle_per_distance, 0, 10);
  visit("angle_per_angle", s.angle_per_angle, 0, 10);
  visit("distance_floor", s.distance_floor, 1e-6, 10);
  visit("angle_floor", s.angle_floor, 1e-6, 10);
  visit("hit_deviation", s.hit_deviation, 1e-3, 10);
  visit("hit_reach", s.hit_reach, 1e-2, 10);
  visit("hit_share", s.hit_share, 0.01, 0.999);
  visit("hit_every", s.hit_every, 1, 1000);
  visit("likelihood_power", s.likelihood_power, 1e-3, 10);
  visit("resample_below", s.resample_below, 0, 1);
}

/// visitSettings() as a value that templates take.
constexpr auto kVisitMapper = [](MapperSettings& settings, auto&& visit) { visitSettings(settings, visit); };

}  // namespace

std::vector<std::string> settingNames() { return namesOf<MapperSettings>(kVisitMapper); }

MapperSettings makeSettings(const ValueOf& value_of) { return made<MapperSettings>(kVisitMapper, value_of); }

}  // namespace kurumaisu
