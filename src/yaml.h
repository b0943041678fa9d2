// SPDX-License-Identifier: BSD-3-Clause
// A YAML file, read strictly, for programs without ROS.
#pragma once

#include <yaml-cpp/yaml.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "section.h"

namespace kurumaisu {

/// A node of a YAML file, for BasicSection. Scalars are what YAML 1.1 and rosparam take them for, without its odd
/// forms: 0x1F, 0o17, 1_000, yes and off are strings here.
class YamlValue {
 public:
  YamlValue(const YAML::Node& node, std::string file) : node_(node), file_(std::move(file)) {}

  /// The only document of a file. Throws std::invalid_argument naming the file and, if it can, the line.
  static YamlValue load(const std::string& file);
  static std::string rootOf(const std::string& /*file*/) { return ""; }

  /// "dac.yaml:7: "
  std::string place() const;
  int line() const { return node_.Mark().line + 1; }

  Kind kind() const;
  bool flag() const;
  int integer() const;
  double number() const;
  std::string text() const;
  std::vector<YamlValue> list() const;

  /// Throws std::invalid_argument for a key that is given twice, or is no scalar.
  std::map<std::string, YamlValue> mapping() const;

  /// A scalar as it is written; of others what they are.
  std::string shown() const;

 private:
  YAML::Node node_;
  std::string file_;
};

using YamlSection = BasicSection<YamlValue>;

}  // namespace kurumaisu
