// SPDX-License-Identifier: BSD-3-Clause
// ROS parameters, read strictly.
#pragma once

#include <ros/param.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "section.h"

namespace kurumaisu {

/// A parameter, for BasicSection.
class RosValue {
 public:
  RosValue(const XmlRpc::XmlRpcValue& value) : value_(value) {}  // implicit: a Section is made of either

  static RosValue load(const std::string& name) {
    XmlRpc::XmlRpcValue value;
    if (ros::param::get(name, value)) return value;
    throw std::invalid_argument(name + " is not set: its launch file loads the parameters");
  }
  static std::string rootOf(const std::string& name) { return name; }
  static std::string place() { return ""; }

  Kind kind() const {
    using Type = XmlRpc::XmlRpcValue;
    switch (value_.getType()) {
      case Type::TypeBoolean:
        return Kind::kFlag;
      case Type::TypeInt:
        return Kind::kInteger;
      case Type::TypeDouble:
        return Kind::kNumber;
      case Type::TypeString:
        return Kind::kText;
      case Type::TypeArray:
        return Kind::kList;
      case Type::TypeStruct:
        return Kind::kMapping;
      default:
        return Kind::kNone;
    }
  }

  // Each for a value of its kind; number() for an integer as well.
  bool flag() const { return held<bool>(); }
  int integer() const { return held<int>(); }
  double number() const { return kind() == Kind::kInteger ? held<int>() : held<double>(); }
  std::string text() const { return held<std::string>(); }

  std::vector<RosValue> list() const {
    std::vector<RosValue> result;
    result.reserve(value_.size());
    // An XmlRpcValue has no iterators of a list.
    for (int i = 0; i < value_.size(); ++i) result.emplace_back(value_[i]);  // NOLINT(modernize-loop-convert)
    return result;
  }

  std::map<std::string, RosValue> mapping() const { return {value_.begin(), value_.end()}; }

  std::string shown() const {
    std::ostringstream out;
    value_.write(out);
    return out.str();
  }

 private:
  template <typename T>
  T held() const {
    XmlRpc::XmlRpcValue copy = value_;  // its conversions are not const
    return static_cast<T>(copy);
  }

  XmlRpc::XmlRpcValue value_;
};

using Section = BasicSection<RosValue>;

}  // namespace kurumaisu
