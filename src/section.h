// SPDX-License-Identifier: BSD-3-Clause
// Strict reader of configuration: every key is read exactly once, so a misspelt one cannot survive. No ROS.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace kurumaisu {

/// What a value is, wherever it was written.
enum class Kind { kNone, kFlag, kInteger, kNumber, kText, kList, kMapping };

/// A mapping whose keys are taken one by one; ask end() for what is left.
///
/// Every reader throws std::invalid_argument naming where the key is, its full name and the value when the key is
/// missing, of the wrong type (an integer passes for a number, nothing else for anything else) or senseless.
///
/// Value: RosValue (params.h) or YamlValue (yaml.h).
template <typename Value>
class BasicSection {
 public:
  /// Everything under an absolute name on the parameter server, or in a file.
  static BasicSection load(const std::string& name) { return {Value::load(name), Value::rootOf(name)}; }

  /// path: the full name of the value, for messages.
  BasicSection(const Value& value, std::string path) : path_(std::move(path)) {
    places_[""] = value.place();
    if (value.kind() != Kind::kMapping) throw wrongType("", "a mapping", value);
    values_ = value.mapping();
    for (const auto& item : values_) places_[item.first] = item.second.place();
  }

  /// What to throw about a key; the empty key is the section itself.
  std::invalid_argument error(const std::string& key, const std::string& message) const {
    const auto place = places_.find(key);
    const std::string name = nameOf(key);
    const std::string where = place == places_.end() ? places_.at("") : place->second;
    return std::invalid_argument(where + name + (name.empty() ? "" : ": ") + message);
  }

  /// A finite number.
  double number(const std::string& key) {
    const Value value = take(key);
    const double result = asNumber(key, value);
    if (!std::isfinite(result)) throw error(key, "must be finite: " + value.shown());
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
    const Value value = take(key);
    if (value.kind() != Kind::kInteger) throw wrongType(key, "an integer", value);
    const int result = value.integer();
    if (result < at_least) throw error(key, "must be at least " + shown(at_least) + ": " + value.shown());
    return result;
  }

  int integer(const std::string& key, int at_least, int at_most) {
    const int result = integer(key, at_least);
    if (result <= at_most) return result;
    throw error(key, "must be at most " + shown(at_most) + ": " + shown(result));
  }

  bool flag(const std::string& key) {
    const Value value = take(key);
    if (value.kind() != Kind::kFlag) throw wrongType(key, "true or false", value);
    return value.flag();
  }

  /// A string that is not empty; or, for textOrNone, may be.
  std::string text(const std::string& key) {
    std::string result = textOrNone(key);
    if (result.empty()) throw error(key, "must not be empty");
    return result;
  }
  std::string textOrNone(const std::string& key) {
    const Value value = take(key);
    if (value.kind() != Kind::kText) throw wrongType(key, "a string", value);
    return value.text();
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
    const Value value = take(key);
    const std::vector<Value> list = value.kind() == Kind::kList ? value.list() : std::vector<Value>();
    if (value.kind() != Kind::kList || list.size() != static_cast<std::size_t>(count)) {
      throw wrongType(key, "a list of " + shown(count) + " numbers", value);
    }
    std::vector<double> result;
    for (const Value& each : list) {
      result.push_back(asNumber(key, each));
      if (!std::isfinite(result.back())) throw error(key, "must be finite: " + each.shown());
    }
    return result;
  }

  /// A list of strings, perhaps empty.
  std::vector<std::string> texts(const std::string& key) {
    const Value value = take(key);
    if (value.kind() != Kind::kList) throw wrongType(key, "a list of strings", value);
    std::vector<std::string> result;
    for (const Value& each : value.list()) {
      if (each.kind() != Kind::kText) throw wrongType(key, "a list of strings", value);
      result.push_back(each.text());
    }
    return result;
  }

  /// A mapping inside this one.
  BasicSection section(const std::string& key) { return {take(key), nameOf(key)}; }

  /// A list of mappings, perhaps empty.
  std::vector<BasicSection> sections(const std::string& key) {
    const Value value = take(key);
    if (value.kind() != Kind::kList) throw wrongType(key, "a list", value);
    std::vector<BasicSection> result;
    for (const Value& each : value.list()) {
      result.emplace_back(each, nameOf(key) + "[" + shown(result.size()) + "]");
    }
    return result;
  }

  /// Leaves a key, if there is one, to another reader of the same file.
  void ignore(const std::string& key) { values_.erase(key); }

  /// The keys not yet taken, in alphabetical order.
  std::vector<std::string> names() const {
    std::vector<std::string> result;
    result.reserve(values_.size());
    for (const auto& item : values_) result.push_back(item.first);
    return result;
  }

  /// Throws unless every key has been taken or ignored.
  void end() const {
    if (values_.empty()) return;
    throw error(values_.begin()->first,
                "is not a known key; its value is " + values_.begin()->second.shown());
  }

 private:
  template <typename T>
  static std::string shown(const T& value) {
    std::ostringstream out;
    out << value;
    return out.str();
  }

  std::string nameOf(const std::string& key) const {
    if (path_.empty() || key.empty()) return path_ + key;
    return path_ + "/" + key;
  }

  std::invalid_argument wrongType(const std::string& key, const std::string& wanted,
                                  const Value& value) const {
    const std::string hint = value.kind() == Kind::kText ? ", a string (YAML wants 1.0e-3, not 1e-3)" : "";
    return error(key, "must be " + wanted + ", not " + value.shown() + hint);
  }

  Value take(const std::string& key) {
    const auto found = values_.find(key);
    if (found == values_.end()) throw error(key, "is missing");
    Value value = found->second;
    values_.erase(found);
    return value;
  }

  double asNumber(const std::string& key, const Value& value) const {
    if (value.kind() == Kind::kInteger || value.kind() == Kind::kNumber) return value.number();
    throw wrongType(key, "a number", value);
  }

  std::string path_;
  std::map<std::string, Value> values_;
  std::map<std::string, std::string> places_;  // of every key, taken or not; of the section itself: ""
};

}  // namespace kurumaisu
