// SPDX-License-Identifier: BSD-3-Clause
#include "guard/settings.h"

#include <filesystem>
#include <stdexcept>

#include "yaml.h"

namespace kurumaisu::guard {
namespace {

constexpr int kHighestPriority = 99;  // sched(7)

Band readBand(YamlSection section) {
  const Band band{section.number("low"), section.number("high"), section.above("step", 0)};
  section.end();
  return band;
}

/// The reference is the chair's: the model file, of which all else has other readers.
double readReference(const std::string& file) {
  YamlSection model = YamlSection::load(file);
  return model.number("reference_voltage");
}

Limits readLimits(YamlSection section, double reference) {
  Limits limits{};
  limits.translation = readBand(section.section("translation"));
  limits.steering = readBand(section.section("steering"));
  limits.reference = reference;
  limits.reference_tolerance = section.atLeast("reference_tolerance", 0);
  limits.neutral = section.atLeast("neutral", 0);
  limits.arming = section.above("arming", 0);
  limits.silence = section.above("silence", 0);
  limits.age = section.above("age", 0);
  section.end();
  try {
    validate(limits);
  } catch (const std::invalid_argument& problem) {
    throw section.error("", problem.what());
  }
  return limits;
}

BackOff readBackOff(YamlSection section) {
  const double first = section.above("first", 0);
  const BackOff back_off{first, section.atLeast("longest", first)};
  section.end();
  return back_off;
}

}  // namespace

Settings readSettings(const std::string& file) {
  YamlSection top = YamlSection::load(file);
  Settings settings{};
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  settings.limits = readLimits(top.section("limits"), readReference(folder / top.text("model")));
  settings.socket = top.text("socket");
  settings.period = top.above("period", 0);
  settings.priority = top.integer("priority", 0, kHighestPriority);
  settings.reopening = readBackOff(top.section("reopening"));
  settings.sentinel_silence = top.above("sentinel_silence", 0);
  settings.restart_pause = top.atLeast("restart_pause", 0);
  settings.neutral_patience = top.atLeast("neutral_patience", 0);
  top.end();
  if (settings.sentinel_silence <= settings.period) {
    throw top.error("sentinel_silence", "must be longer than period: in each there is a sign of life");
  }
  return settings;
}

}  // namespace kurumaisu::guard
