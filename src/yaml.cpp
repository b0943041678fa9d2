// SPDX-License-Identifier: BSD-3-Clause
#include "yaml.h"

#include <charconv>
#include <cstdint>
#include <limits>
#include <optional>
#include <regex>
#include <stdexcept>
#include <system_error>

#include "regular_file.h"

namespace kurumaisu {
namespace {

constexpr std::uintmax_t kMostBytes = 1U << 20U;  // of a file
constexpr std::size_t kMostTold = 100;            // characters of a value in a message

std::string placeOf(const std::string& file, const YAML::Mark& mark) {
  return file + ":" + (mark.is_null() ? "" : std::to_string(mark.line + 1) + ":") + " ";
}

std::optional<int> asInteger(const std::string& text) {
  static const std::regex form("[-+]?(0|[1-9][0-9]*)");
  if (!std::regex_match(text, form)) return std::nullopt;
  const char* begin = text.data() + (text[0] == '+' ? 1 : 0);
  int value = 0;
  if (std::from_chars(begin, text.data() + text.size(), value).ec != std::errc()) return std::nullopt;
  return value;
}

/// A number with a point; its exponent, if any, with a sign.
std::optional<double> asNumber(const std::string& text) {
  static const std::regex form(R"([-+]?([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+][0-9]+)?)");
  static const std::regex infinite(R"([-+]?\.(inf|Inf|INF))");
  static const std::regex none(R"(\.(nan|NaN|NAN))");
  if (std::regex_match(text, none)) return std::numeric_limits<double>::quiet_NaN();
  const double sign = text[0] == '-' ? -1 : 1;
  if (std::regex_match(text, infinite)) return sign * std::numeric_limits<double>::infinity();
  if (!std::regex_match(text, form)) return std::nullopt;
  const char* begin = text.data() + (text[0] == '+' ? 1 : 0);
  double value = 0;
  const auto result = std::from_chars(begin, text.data() + text.size(), value);
  if (result.ec == std::errc::result_out_of_range) return sign * std::numeric_limits<double>::infinity();
  return value;
}

/// A value for a message, which has no room for a long one.
std::string cut(const std::string& text) {
  return text.size() <= kMostTold ? text : text.substr(0, kMostTold) + "...";
}

Kind kindOfPlain(const std::string& text) {
  if (text.empty() || text == "~" || text == "null" || text == "Null" || text == "NULL") return Kind::kNone;
  for (const char* flag : {"true", "True", "TRUE", "false", "False", "FALSE"}) {
    if (text == flag) return Kind::kFlag;
  }
  if (text.size() > 100) return Kind::kText;  // std::regex recurses
  if (asInteger(text)) return Kind::kInteger;
  return asNumber(text) ? Kind::kNumber : Kind::kText;
}

}  // namespace

YamlValue YamlValue::load(const std::string& file) {
  const std::string why = whyNotRead(file, kMostBytes);
  if (!why.empty()) throw std::invalid_argument(file + ": " + why);
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAllFromFile(file);
    if (documents.size() == 1) return {documents.front(), file};
    throw std::invalid_argument(file + ": must hold one document, not " + std::to_string(documents.size()));
  } catch (const YAML::BadFile&) {
    throw std::invalid_argument(file + ": cannot be read");
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument(placeOf(file, error.mark) + error.msg);
  }
}

std::string YamlValue::place() const { return placeOf(file_, node_.Mark()); }

Kind YamlValue::kind() const {
  if (node_.IsMap()) return Kind::kMapping;
  if (node_.IsSequence()) return Kind::kList;
  if (!node_.IsScalar()) return Kind::kNone;
  return node_.Tag() == "?" ? kindOfPlain(node_.Scalar()) : Kind::kText;  // else it is quoted
}

bool YamlValue::flag() const { return node_.Scalar()[0] == 't' || node_.Scalar()[0] == 'T'; }

int YamlValue::integer() const { return asInteger(node_.Scalar()).value(); }

double YamlValue::number() const {
  const std::string& text = node_.Scalar();
  const std::optional<int> integer = asInteger(text);
  return integer ? *integer : asNumber(text).value();
}

std::string YamlValue::text() const { return node_.Scalar(); }

std::vector<YamlValue> YamlValue::list() const {
  std::vector<YamlValue> result;
  for (const YAML::Node& each : node_) result.emplace_back(each, file_);
  return result;
}

std::map<std::string, YamlValue> YamlValue::mapping() const {
  std::map<std::string, YamlValue> result;
  for (const auto& item : node_) {
    const YamlValue key(item.first, file_);
    if (!item.first.IsScalar()) throw std::invalid_argument(key.place() + "a key must be a word");
    if (result.emplace(key.text(), YamlValue(item.second, file_)).second) continue;
    throw std::invalid_argument(key.place() + cut(key.text()) + ": is given twice");
  }
  return result;
}

std::string YamlValue::shown() const {
  if (node_.IsMap()) return "a mapping";
  if (node_.IsSequence()) return "a list";
  if (!node_.IsScalar()) return "nothing";
  return cut(node_.Scalar());
}

}  // namespace kurumaisu
