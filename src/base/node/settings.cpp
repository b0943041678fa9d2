// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/settings.h"

#include <algorithm>

namespace kurumaisu {
namespace {

constexpr int kLowest = 0;  // priority
constexpr int kHighest = 255;
constexpr double kSlowest = 0.1;  // [Hz]
constexpr double kFastest = 1000;

int readPriority(Section& section) { return section.integer("priority", kLowest, kHighest); }

/// Sections by name. XmlRpc knows no order of keys: alphabetical.
template <typename Take>
void readEach(Section& section, Take take) {
  for (const std::string& name : section.names()) {
    Section item = section.section(name);
    take(name, item);
    item.end();
  }
}

/// The model file also describes the body and the laser: those have other readers.
void readModel(Section model, BaseSettings& settings) {
  settings.drive.outlet = readOutlet(model, settings.law_name);
  for (const char* other : {"name", "chassis", "laser"}) model.ignore(other);
  settings.effects = readEffects(model);
  model.end();
}

void readLimitSets(Section section, BaseSettings& settings) {
  for (const std::string& name : section.names()) {
    settings.limit_names.push_back(name);
    settings.drive.limits.push_back(readLimits(section.section(name)));
  }
  if (settings.limit_names.empty()) throw section.error("", "must name at least one set of limits");
}

void readInputs(Section section, BaseSettings& settings) {
  const std::vector<std::string>& sets = settings.limit_names;
  readEach(section, [&](const std::string& name, Section& item) {
    settings.topics.inputs.push_back(item.text("topic"));
    const int priority = readPriority(item);
    const double timeout = item.above("timeout", 0);
    const bool several = item.flag("allow_several");
    const auto found = std::find(sets.begin(), sets.end(), item.choice("limits", sets));
    const auto limits = static_cast<std::size_t>(found - sets.begin());
    for (const InputSettings& other : settings.drive.arbiter.inputs) {
      if (other.priority != priority) continue;
      throw item.error("priority",
                       "must differ from that of " + other.name + ": " + std::to_string(priority));
    }
    settings.drive.arbiter.inputs.push_back({name, priority, timeout, several, limits});
  });
  if (settings.topics.inputs.empty()) throw section.error("", "must name at least one input");
}

void readLocks(Section section, BaseSettings& settings) {
  readEach(section, [&settings](const std::string& name, Section& item) {
    settings.topics.locks.push_back(item.text("topic"));
    const int priority = readPriority(item);
    const double timeout = item.atLeast("timeout", 0);
    settings.drive.arbiter.locks.push_back(
        {name, priority, timeout, item.flag("blocks_on"), item.flag("from_start")});
  });
}

void readWatchers(Section& node, BaseSettings& settings) {
  Section rest = node.section("rest");
  const Rates least{rest.atLeast("v", 0), rest.atLeast("w", 0)};
  rest.end();
  Section absurd = node.section("absurd");
  settings.drive.arbiter.absurd = {absurd.above("v", least.v), absurd.above("w", least.w)};
  settings.drive.arbiter.rest = least;
  absurd.end();
  Section estop = node.section("estop");
  settings.topics.estop = estop.text("topic");
  settings.drive.estop_timeout = estop.atLeast("timeout", 0);
  estop.end();
  Section cap = node.section("speed_cap");
  settings.topics.speed_cap = cap.text("topic");
  settings.drive.cap = {cap.above("timeout", 0), cap.atLeast("fallback", 0)};
  cap.end();
}

AllowedHosts readHosts(Section& node) {
  try {
    return AllowedHosts(node.texts("allowed_hosts"));
  } catch (const AllowedHosts::Unknown& error) {
    throw node.error("allowed_hosts", error.what());
  }
}

/// One topic, one meaning.
void checkTopics(const Section& node, const BaseTopics& topics) {
  std::vector<std::string> all = topics.inputs;
  all.insert(all.end(), topics.locks.begin(), topics.locks.end());
  all.insert(all.end(), {topics.estop, topics.speed_cap});
  std::sort(all.begin(), all.end());
  const auto twice = std::adjacent_find(all.begin(), all.end());
  if (twice != all.end()) throw node.error("", "names the topic " + *twice + " twice");
}

}  // namespace

Limits readLimits(Section section) {
  const RampLimits v{section.above("v_acceleration", 0), section.above("v_deceleration", 0),
                     section.above("v_jerk", 0)};
  const RampLimits w{section.above("w_acceleration", 0), section.above("w_deceleration", 0),
                     section.above("w_jerk", 0)};
  const Limits limits{section.above("v_forward", 0),
                      section.above("v_reverse", 0),
                      section.above("w", 0),
                      v,
                      w,
                      section.above("lateral_acceleration", 0),
                      section.flag("keep_curvature")};
  section.end();
  return limits;
}

BaseSettings readBaseSettings(Section node) {
  BaseSettings settings;
  readModel(node.section("model"), settings);
  readLimitSets(node.section("limits"), settings);
  readInputs(node.section("inputs"), settings);
  readLocks(node.section("locks"), settings);
  readWatchers(node, settings);
  checkTopics(node, settings.topics);
  settings.drive.longest_step = node.above("longest_step", 0);
  settings.rate = node.within("rate", kSlowest, kFastest);
  if (settings.drive.longest_step * settings.rate < 1) {
    throw node.error("longest_step",
                     "must be at least one period of rate: " + std::to_string(settings.drive.longest_step));
  }
  settings.dac = readDac(node.section("dac"), node.section("guard"));
  settings.drive.arbiter.first_word_is_rest = settings.dac.guard.has_value();
  settings.odometry = readOdometry(node.section("odometry"), settings.effects);
  settings.drive.noise = settings.odometry.noise;
  if (settings.odometry.imu) settings.drive.gyro = settings.odometry.imu->gyro;
  settings.master_timeout = node.atLeast("master_timeout", 0);
  settings.allowed_hosts = readHosts(node);
  settings.diagnostic_period = node.above("diagnostic_period", 0);
  node.end();
  return settings;
}

}  // namespace kurumaisu
