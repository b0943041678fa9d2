// SPDX-License-Identifier: BSD-3-Clause
#include "base/settings.h"

#include <map>

namespace kurumaisu {
namespace {

Branch readBranch(Section section) {
  const Branch branch{section.number("slope"), section.number("intercept")};
  section.end();
  if (branch.slope == 0) throw section.error("slope", "must not be 0: 0");
  return branch;
}

AxisLaw readAxis(Section section) {
  const AxisLaw law{readBranch(section.section("positive")), readBranch(section.section("negative"))};
  section.end();
  try {
    validate(law);
  } catch (const std::invalid_argument& problem) {
    throw section.error("", problem.what());
  }
  return law;
}

VoltageLaw readLaw(Section section) {
  const VoltageLaw law{readAxis(section.section("translation")), readAxis(section.section("steering"))};
  section.end();
  return law;
}

/// The model file also describes the body, the laser and the simulator's effects: those have other readers.
void readModel(Section model, BaseSettings& settings) {
  Section laws = model.section("voltage_laws");
  settings.law_name = model.choice("voltage_law", laws.names());
  for (const std::string& name : laws.names()) {
    const VoltageLaw law = readLaw(laws.section(name));  // a mistake in a law not in use is one all the same
    if (name == settings.law_name) settings.drive.law = law;
  }
  settings.drive.reference_voltage = model.number("reference_voltage");
  for (const char* other : {"name", "chassis", "laser"}) model.ignore(other);
  settings.effects = readEffects(model);
  model.end();
}

Limits readLimits(Section section) {
  const Limits limits{section.above("v_forward", 0), section.above("v_reverse", 0), section.above("w", 0)};
  section.end();
  return limits;
}

}  // namespace

BaseSettings readBaseSettings(Section node) {
  BaseSettings settings;
  readModel(node.section("model"), settings);
  settings.drive.limits = readLimits(node.section("limits"));
  settings.drive.command_timeout = node.above("command_timeout", 0);
  settings.rate = node.above("rate", 0);
  settings.odometry = readOdometry(node.section("odometry"), settings.effects);
  settings.drive.noise = settings.odometry.noise;
  if (settings.odometry.imu) settings.drive.gyro = settings.odometry.imu->gyro;
  settings.diagnostic_period = node.above("diagnostic_period", 0);
  node.end();
  return settings;
}

}  // namespace kurumaisu
