// SPDX-License-Identifier: BSD-3-Clause
// The shipped sensors for tests in C++: as much YAML as launch/urg/*.yaml is written in. Programs read them in Python.
#pragma once

#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include "virtual_urg/model.h"

namespace kurumaisu::virtual_urg {

/// One `key: value`; with the section before the key, if it has one.
struct Entry {
  std::string section, key, value;
};

inline std::string trimmed(const std::string& text) {
  const std::size_t from = text.find_first_not_of(' ');
  return from == std::string::npos ? "" : text.substr(from, text.find_last_not_of(' ') - from + 1);
}

inline std::string unquoted(const std::string& text) {
  return text.size() >= 2 && text.front() == '"' ? text.substr(1, text.size() - 2) : text;
}

inline std::vector<Entry> entriesOf(std::istream& file) {
  std::vector<Entry> entries;
  std::string section;
  for (std::string line; std::getline(file, line);) {
    const std::string text = trimmed(line.substr(0, line.find(" #")));
    if (text.empty() || text.front() == '#') continue;
    const std::size_t colon = text.find(':');
    const Entry entry{line.front() == ' ' ? section : "", text.substr(0, colon),
                      unquoted(trimmed(text.substr(colon + 1)))};
    if (entry.value.empty() || entry.value == "{}")
      section = entry.key;
    else
      entries.push_back(entry);
  }
  return entries;
}

inline std::vector<int> listOf(const std::string& text) {
  std::istringstream numbers(text.substr(1, text.size() - 2));
  std::vector<int> values;
  for (std::string number; std::getline(numbers, number, ',');) values.push_back(std::stoi(number));
  return values;
}

inline void set(Model& model, const Entry& entry) {
  const auto& [section, key, value] = entry;
  const std::map<std::string, Lines*> sections{{"version", &model.version},
                                               {"version_11", &model.version_11},
                                               {"parameters", &model.parameters},
                                               {"state", &model.state}};
  const std::map<std::string, std::string*> texts{
      {"name", &model.name}, {"laser_on", &model.laser_on},   {"laser_off", &model.laser_off},
      {"idle", &model.idle}, {"measuring", &model.measuring}, {"healthy", &model.healthy},
      {"ill", &model.ill}};
  const std::map<std::string, int*> numbers{
      {"protocol", &model.protocol},    {"baud", &model.baud},
      {"end_step", &model.end_step},    {"no_return", &model.codes.no_return},
      {"error", &model.codes.error},    {"too_near", &model.codes.too_near},
      {"outside", &model.codes.outside}};
  const std::map<std::string, double*> times{{"boot_time", &model.boot_time},
                                             {"output_delay", &model.output_delay}};
  if (sections.count(section) > 0)
    sections.at(section)->emplace_back(key, value);
  else if (section == "refused")
    model.refused[key] = value;
  else if (texts.count(key) > 0)
    *texts.at(key) = value;
  else if (numbers.count(key) > 0)
    *numbers.at(key) = std::stoi(value);
  else if (times.count(key) > 0)
    *times.at(key) = std::stod(value);
  else if (key == "bauds")
    model.bauds = listOf(value);
  else if (key == "bad_serial_sum")
    model.bad_serial_sum = value == "true";
  else
    throw std::invalid_argument("unknown key " + key);
}

/// A sensor's file. Throws std::invalid_argument for a key that is not known, std::runtime_error if there is no file.
inline Model modelOf(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  Model model;
  for (const Entry& entry : entriesOf(file)) set(model, entry);
  return model;
}

}  // namespace kurumaisu::virtual_urg
