// SPDX-License-Identifier: BSD-3-Clause
// The parameters of mapping_node before they are read: slam_gmapping's names, and what nobody has set.
#pragma once

#include <ros/console.h>
#include <ros/param.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <algorithm>
#include <string>
#include <vector>

#include "slam/mapping/gmapping_names.h"
#include "yaml.h"

namespace kurumaisu {

inline XmlRpc::XmlRpcValue rosValueOf(const YamlValue& value) {
  XmlRpc::XmlRpcValue out;
  switch (value.kind()) {
    case Kind::kFlag:
      return {value.flag()};
    case Kind::kInteger:
      return {value.integer()};
    case Kind::kNumber:
      return {value.number()};
    case Kind::kList:
      out.setSize(0);
      for (const YamlValue& each : value.list()) out[out.size()] = rosValueOf(each);
      return out;
    case Kind::kMapping:
      for (const auto& [key, each] : value.mapping()) out[key] = rosValueOf(each);
      return out;
    default:
      return {value.kind() == Kind::kText ? value.text() : ""};
  }
}

/// Lays what nobody has set below what somebody has.
inline void layBelow(XmlRpc::XmlRpcValue& top, const XmlRpc::XmlRpcValue& below) {
  using Value = XmlRpc::XmlRpcValue;
  for (const auto& [key, value] : below) {
    if (!top.hasMember(key)) {
      top[key] = value;
    } else if (value.getType() == Value::TypeStruct && top[key].getType() == Value::TypeStruct) {
      layBelow(top[key], value);
    }
  }
}

// Apart, because the macros count as a handful of branches each.
inline void tellUnsupported(const GmappingName& name) {
  ROS_WARN("MAPPING_UNSUPPORTED: %s: is not used: %s", name.name, name.key);
}
inline void tellTaken(const GmappingName& name) {
  ROS_INFO("mapping: %s: is used as %s/%s", name.name, name.section, name.key);
}

/// A value of slam_gmapping as one of ours: there, times below 0 mean never.
inline XmlRpc::XmlRpcValue ourValueOf(const GmappingName& name, XmlRpc::XmlRpcValue value) {
  const bool is_time = std::string(name.name) == "temporalUpdate";
  const bool is_number = value.getType() == XmlRpc::XmlRpcValue::TypeDouble;
  return is_time && is_number && static_cast<double>(value) < 0 ? XmlRpc::XmlRpcValue(0.0) : value;
}

/// Moves slam_gmapping's parameters to where ours are, and says so; those that mean nothing here are taken away, and
/// returned by name.
inline std::vector<std::string> takeGmappingNames(XmlRpc::XmlRpcValue& top) {
  std::vector<std::string> unused;
  XmlRpc::XmlRpcValue ours;
  for (const auto& [key, value] : top) {
    const auto& names = gmappingNames();
    if (std::none_of(names.begin(), names.end(), [&key = key](const auto& n) { return key == n.name; }))
      ours[key] = value;
  }
  for (const GmappingName& each : gmappingNames()) {
    if (!top.hasMember(each.name)) continue;
    if (each.section == nullptr) {
      tellUnsupported(each);
      unused.emplace_back(each.name);
    } else {
      tellTaken(each);
      ours[each.section][each.key] = ourValueOf(each, top[each.name]);
    }
  }
  top = ours;
  return unused;
}

/// Makes the parameters under an absolute name complete: with slam_gmapping's names, and with these files for what is
/// not set. Returns the names that are not used.
inline std::vector<std::string> completeParameters(const std::string& name, const std::string& settings_file,
                                                   const std::string& model_file) {
  XmlRpc::XmlRpcValue top;
  ros::param::get(name, top);
  std::vector<std::string> unused;
  if (top.getType() == XmlRpc::XmlRpcValue::TypeStruct) unused = takeGmappingNames(top);
  layBelow(top, rosValueOf(YamlValue::load(settings_file)));
  if (!top.hasMember("model")) top["model"] = rosValueOf(YamlValue::load(model_file));
  ros::param::set(name, top);
  return unused;
}

}  // namespace kurumaisu
