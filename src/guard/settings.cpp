// SPDX-License-Identifier: BSD-3-Clause
#include "guard/settings.h"

#include <filesystem>
#include <stdexcept>

#include "yaml.h"

namespace kurumaisu::guard {
namespace {

constexpr int kHighestPriority = 99;  // sched(7)

constexpr double kRounding = 1e-9;  // [V] by which codes at the end of a band may go beyond it

/// How far the model file lets a voltage go; what else it says of it is base_node's.
Band readBand(YamlSection section) {
  return {section.number("min") - kRounding, section.number("max") + kRounding, 0, 0};
}

void readStep(YamlSection section, Band& band) {
  band.step = section.above("step", 0);
  band.rate = section.above("rate", 0);
  section.end();
}

/// Of the model file, which has other readers for all else.
void readModel(const std::string& file, Limits& limits) {
  YamlSection model = YamlSection::load(file);
  YamlSection voltages = model.section("voltages");
  limits.translation = readBand(voltages.section("translation"));
  limits.steering = readBand(voltages.section("steering"));
  limits.reference = model.number("reference_voltage");
}

Limits readLimits(YamlSection section, const std::string& model_file) {
  Limits limits{};
  readModel(model_file, limits);
  readStep(section.section("translation"), limits.translation);
  readStep(section.section("steering"), limits.steering);
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
  settings.limits = readLimits(top.section("limits"), folder / top.text("model"));
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
