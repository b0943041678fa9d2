// SPDX-License-Identifier: BSD-3-Clause
#include "laser/shipped.h"

#include <mrpt/containers/yaml.h>

#include <charconv>
#include <system_error>

namespace kurumaisu::laser {
namespace {

template <typename Number>
bool isWhole(const std::string& text, Number& number) {
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return error == std::errc() && stop == end;
}

XmlRpc::XmlRpcValue scalar(const std::string& text) {
  if (text == "true" || text == "false") return XmlRpc::XmlRpcValue(text == "true");
  int integer = 0;
  if (isWhole(text, integer)) return XmlRpc::XmlRpcValue(integer);
  double number = 0;
  if (isWhole(text, number)) return XmlRpc::XmlRpcValue(number);
  return XmlRpc::XmlRpcValue(text);
}

}  // namespace

XmlRpc::XmlRpcValue loadShipped(const std::string& path) try {
  const mrpt::containers::yaml tree = mrpt::containers::yaml::FromFile(path);
  XmlRpc::XmlRpcValue values;
  for (const auto& [key, node] : tree.asMap()) values[key.as<std::string>()] = scalar(node.as<std::string>());
  return values;
} catch (const std::exception& problem) {
  throw std::invalid_argument(path + ": " + problem.what());
}

}  // namespace kurumaisu::laser
