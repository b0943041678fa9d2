// SPDX-License-Identifier: BSD-3-Clause
#include "dac/unfilled.h"

#include <map>
#include <stdexcept>
#include <string>

namespace kurumaisu::dac {
namespace {

constexpr int kDepthMost = 10;  // an alias can name what it is in

using Found = std::multimap<int, std::string>;  // messages by line

void collect(const YamlValue& value, const std::string& key, int depth, Found& found) {
  if (depth > kDepthMost) return;
  if (value.kind() == Kind::kMapping) {
    for (const auto& item : value.mapping()) collect(item.second, item.first, depth + 1, found);
  } else if (value.kind() == Kind::kList) {
    for (const YamlValue& each : value.list()) collect(each, key, depth + 1, found);
  } else if (value.kind() == Kind::kText && value.text().rfind(kUnfilled, 0) == 0) {
    found.emplace(value.line(), value.place() + key + ": " + value.text());
  }
}

}  // namespace

void refuseUnfilled(const YamlValue& tree) {
  Found found;
  collect(tree, "", 0, found);
  if (found.empty()) return;
  std::string message = "this board cannot be used before its owner fills in these unknown values:";
  for (const auto& item : found) message += "\n" + item.second;
  throw std::invalid_argument(message);
}

}  // namespace kurumaisu::dac
