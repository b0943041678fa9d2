// SPDX-License-Identifier: BSD-3-Clause
// Settings by name: taken one by one, each within its bounds.
#pragma once

#include <cmath>
#include <functional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace kurumaisu {

/// Gives the value for the name of a setting.
using ValueOf = std::function<double(const std::string&)>;

/// Sets a member (double, or int, which needs a whole number) from the value of its name. Throws
/// std::invalid_argument naming the key, its bounds and the value.
template <typename Member>
void setBounded(const ValueOf& value_of, const std::string& name, Member& member, double lower,
                double upper) {
  const double value = value_of(name);
  std::ostringstream text;
  if (!(value >= lower && value <= upper)) {
    text << name << ": must be " << lower << " to " << upper << ": " << value;
    throw std::invalid_argument(text.str());
  }
  member = static_cast<Member>(value);
  if (static_cast<double>(member) != value) {
    text << name << ": must be a whole number: " << value;
    throw std::invalid_argument(text.str());
  }
}

/// Names of the settings that visit(settings, visitor) goes through, calling visitor(name, member, lower, upper).
template <typename Settings, typename Visit>
std::vector<std::string> namesOf(Visit&& visit) {
  std::vector<std::string> names;
  Settings settings{};
  visit(settings,
        [&names](const char* name, const auto& /*member*/, double, double) { names.emplace_back(name); });
  return names;
}

/// The settings themselves, each within its bounds. Throws as setBounded() does.
template <typename Settings, typename Visit>
Settings made(Visit&& visit, const ValueOf& value_of) {
  Settings settings{};
  visit(settings, [&value_of](const char* name, auto& member, double lower, double upper) {
    setBounded(value_of, name, member, lower, upper);
  });
  return settings;
}

}  // namespace kurumaisu
