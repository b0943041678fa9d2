// SPDX-License-Identifier: BSD-3-Clause
// Strict reader of ROS parameters: every key is read exactly once, so a misspelt one cannot survive.
#pragma once

#include <ros/param.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace kurumaisu {

/// A namespace of parameters whose keys are taken one by one; ask end() for what is left.
///
/// Every reader throws std::invalid_argument naming the full parameter name and the value when the key is
/// missing, of the wrong type (an integer passes for a number, nothing else for anything else) or senseless.
class Section {
 public:
  /// Everything under an absolute name on the parameter server.
  static Section load(const std::string& name) {
    XmlRpc::XmlRpcValue value;
    if (!ros::param::get(name, value)) {
      throw std::invalid_argument(name + " is not set: its launch file loads the parameters");
    }
    return {value, name};
  }

  /// path: the absolute name of the value, for messages.
  Section(const XmlRpc::XmlRpcValue& value, std::string path) : path_(std::move(path)) {
    if (value.getType() != XmlRpc::XmlRpcValue::TypeStruct) throw wrongType("", "a mapping", value);
    values_.insert(value.begin(), value.end());
  }

  /// What to throw about a key; the empty key is the section itself.
  std::invalid_argument error(const std::string& key, const std::string& message) const {
    return std::invalid_argument(path_ + (key.empty() ? "" : "/" + key) + ": " + message);
  }

  /// A finite number.
  double number(const std::string& key) {
    const XmlRpc::XmlRpcValue value = take(key);
    const double result = asNumber(key, value);
    if (!std::isfinite(result)) throw error(key, "must be finite: " + shown(value));
    return result;
  }

  /// A finite number that is at least (or, for above, more than) the bound.
  double atLeast(const std::string& key, double bound) {
    const double value = number(key);
    if (value < bound) throw error(key, "must be at least " + shown(bound) + ": " + shown(value));
    return value;
  }
  double above(const std::string& key, double bound) {
    const double value = number(key);
    if (value <= bound) throw error(key, "must be above " + shown(bound) + ": " + shown(value));
    return value;
  }

  double within(const std::string& key, double low, double high) {
    const double value = number(key);
    if (low <= value && value <= high) return value;
    throw error(key, "must be from " + shown(low) + " to " + shown(high) + ": " + shown(value));
  }

  /// An integer; 3.0 is none, where roscpp would round even 3.4.
  int integer(const std::string& key, int at_least) {
    const XmlRpc::XmlRpcValue value = take(key);
    if (value.getType() != XmlRpc::XmlRpcValue::TypeInt) throw wrongType(key, "an integer", value);
    const int result = value;
    if (result < at_least) throw error(key, "must be at least " + shown(at_least) + ": " + shown(value));
    return result;
  }

  int integer(const std::string& key, int at_least, int at_most) {
    const int result = integer(key, at_least);
    if (result <= at_most) return result;
    throw error(key, "must be at most " + shown(at_most) + ": " + shown(result));
  }

  bool flag(const std::string& key) {
    const XmlRpc::XmlRpcValue value = take(key);
    if (value.getType() != XmlRpc::XmlRpcValue::TypeBoolean) throw wrongType(key, "true or false", value);
    return value;
  }

  /// A string that is not empty; or, for textOrNone, may be.
  std::string text(const std::string& key) {
    std::string result = textOrNone(key);
    if (result.empty()) throw error(key, "must not be empty");
    return result;
  }
  std::string textOrNone(const std::string& key) {
    const XmlRpc::XmlRpcValue value = take(key);
    if (value.getType() != XmlRpc::XmlRpcValue::TypeString) throw wrongType(key, "a string", value);
    return value;
  }

  /// One of the choices.
  std::string choice(const std::string& key, const std::vector<std::string>& choices) {
    std::string value = text(key);
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return value;
    std::string list;
    for (const std::string& each : choices) list += (list.empty() ? "" : ", ") + each;
    throw error(key, "must be one of " + list + ": " + value);
  }

  /// A list of so many finite numbers.
  std::vector<double> numbers(const std::string& key, int count) {
    const XmlRpc::XmlRpcValue list = take(key);
    if (list.getType() != XmlRpc::XmlRpcValue::TypeArray || list.size() != count) {
      throw wrongType(key, "a list of " + shown(count) + " numbers", list);
    }
    std::vector<double> result;
    for (int i = 0; i < count; ++i) {
      result.push_back(asNumber(key, list[i]));
      if (!std::isfinite(result.back())) throw error(key, "must be finite: " + shown(list[i]));
    }
    return result;
  }

  /// A mapping inside this one.
  Section section(const std::string& key) { return {take(key), path_ + "/" + key}; }

  /// A list of mappings.
  std::vector<Section> sections(const std::string& key) {
    const XmlRpc::XmlRpcValue list = take(key);
    if (list.getType() != XmlRpc::XmlRpcValue::TypeArray) throw wrongType(key, "a list", list);
    std::vector<Section> result;
    for (int i = 0; i < list.size(); ++i) result.emplace_back(list[i], path_ + "/" + key + "/" + shown(i));
    return result;
  }

  /// Leaves a key, if there is one, to another reader of the same file.
  void ignore(const std::string& key) { values_.erase(key); }

  /// The keys not yet taken, in alphabetical order.
  std::vector<std::string> names() const {
    std::vector<std::string> result;
    for (const auto& item : values_) result.push_back(item.first);
    return result;
  }

  /// Throws unless every key has been taken or ignored.
  void end() const {
    if (values_.empty()) return;
    throw error(values_.begin()->first, "is not a known key; its value is " + shown(values_.begin()->second));
  }

 private:
  template <typename T>
  static std::string shown(const T& value) {
    std::ostringstream out;
    out << value;
    return out.str();
  }

  static std::string shown(const XmlRpc::XmlRpcValue& value) {
    std::ostringstream out;
    value.write(out);
    return out.str();
  }

  std::invalid_argument wrongType(const std::string& key, const std::string& wanted,
                                  const XmlRpc::XmlRpcValue& value) const {
    using Value = XmlRpc::XmlRpcValue;
    const bool is_text = value.getType() == Value::TypeString;
    const std::string hint = is_text ? ", a string (YAML wants 1.0e-3, not 1e-3)" : "";
    return error(key, "must be " + wanted + ", not " + shown(value) + hint);
  }

  XmlRpc::XmlRpcValue take(const std::string& key) {
    const auto found = values_.find(key);
    if (found == values_.end()) throw error(key, "is missing");
    XmlRpc::XmlRpcValue value = found->second;
    values_.erase(found);
    return value;
  }

  double asNumber(const std::string& key, const XmlRpc::XmlRpcValue& value) const {
    if (value.getType() == XmlRpc::XmlRpcValue::TypeInt) return static_cast<int>(value);
    if (value.getType() == XmlRpc::XmlRpcValue::TypeDouble) return value;
    throw wrongType(key, "a number", value);
  }

  std::string path_;
  XmlRpc::XmlRpcValue::ValueStruct values_;
};

}  // namespace kurumaisu
