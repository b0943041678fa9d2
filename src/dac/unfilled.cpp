// SPDX-License-Identifier: BSD-3-Clause
#include "dac/unfilled.h"

#include <stdexcept>
#include <string>

namespace kurumaisu::dac {
namespace {

constexpr int kDepthMost = 10;  // an alias can name what it is in

void collect(const YamlValue& value, int depth, std::string& found) {
  if (depth > kDepthMost) return;
  if (value.kind() == Kind::kMapping) {
    for (const auto& item : value.mapping()) collect(item.second, depth + 1, found);
  } else if (value.kind() == Kind::kList) {
    for (const YamlValue& each : value.list()) collect(each, depth + 1, found);
  } else if (value.kind() == Kind::kText && value.text().rfind(kUnfilled, 0) == 0) {
    found += "\n" + value.place() + value.text();
  }
}

}  // namespace

void refuseUnfilled(const YamlValue& tree) {
  std::string found;
  collect(tree, 0, found);
  if (found.empty()) return;
  throw std::invalid_argument("this board cannot be used before its owner has filled in what is not known:" +
                              found);
}

}  // namespace kurumaisu::dac
