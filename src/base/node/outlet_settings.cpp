// SPDX-License-Identifier: BSD-3-Clause
// The voltages' part of the model file. A calibration that cannot be right stops the node.
#include <functional>

#include "base/node/settings.h"

namespace kurumaisu {
namespace {

constexpr const char* kPrinted = "published";  // equation (2) as printed overlaps; it is announced instead

Branch readBranch(Section section) {
  const Branch branch{section.number("slope"), section.number("intercept")};
  section.end();
  if (branch.slope == 0) throw section.error("slope", "must not be 0: 0");
  return branch;
}

void checked(const Section& section, const std::string& key, const std::function<void()>& check) {
  try {
    check();
  } catch (const std::invalid_argument& problem) {
    throw section.error(key, problem.what());
  }
}

AxisLaw readAxis(Section section, bool printed) {
  const AxisLaw law{readBranch(section.section("positive")), readBranch(section.section("negative"))};
  section.end();
  checked(section, "", [&law] { validate(law); });
  if (!printed) checked(section, "", [&law] { validateMonotonic(law); });
  return law;
}

VoltageLaw readLaw(Section section, bool printed) {
  const VoltageLaw law{readAxis(section.section("translation"), printed),
                       readAxis(section.section("steering"), printed)};
  section.end();
  return law;
}

Channel readChannel(Section section) {
  const Channel channel{section.number("min"), section.number("max"), section.atLeast("resolution", 0)};
  section.end();
  return channel;
}

void readVoltages(Section section, OutletSettings& settings) {
  settings.knob = section.within("knob", 0, 1);
  settings.translation = readChannel(section.section("translation"));
  settings.steering = readChannel(section.section("steering"));
  checked(section, "translation",
          [&] { validate(settings.law.translation, settings.translation, settings.knob); });
  checked(section, "steering", [&] { validate(settings.law.steering, settings.steering, settings.knob); });
  Section reference = section.section("reference");
  const double low = reference.number("min");
  const double high = reference.number("max");
  reference.end();
  section.end();
  if (settings.reference_voltage >= low && settings.reference_voltage <= high) return;
  throw section.error("reference", "reference_voltage " + std::to_string(settings.reference_voltage) +
                                       " V must lie from min " + std::to_string(low) + " to max " +
                                       std::to_string(high));
}

}  // namespace

OutletSettings readOutlet(Section& model, std::string& law_name) {
  OutletSettings settings{};
  Section laws = model.section("voltage_laws");
  law_name = model.choice("voltage_law", laws.names());
  for (const std::string& name : laws.names()) {
    const VoltageLaw law = readLaw(laws.section(name), name == kPrinted);  // also of a law that is not in use
    if (name == law_name) settings.law = law;
  }
  settings.reference_voltage = model.number("reference_voltage");
  readVoltages(model.section("voltages"), settings);
  return settings;
}

}  // namespace kurumaisu
