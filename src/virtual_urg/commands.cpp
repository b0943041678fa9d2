// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/commands.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "scip/code.h"
#include "virtual_urg/frames.h"
#include "virtual_urg/settings.h"
#include "virtual_urg/statuses.h"

namespace kurumaisu::virtual_urg {
namespace {

constexpr std::size_t kLabelLength = 17;  // ; and 16 letters
constexpr std::size_t kClockWidth = 4;    // characters

constexpr const char* kTooFew = "0C";
constexpr const char* kUnknown = "0E";
constexpr const char* kAdjusting = "0A";  // ASSUMPTION: C-42-03320B says that it refuses, not how
constexpr const char* kLaserOff = "10";

/// Characters after the two of the name; all others are unknown.
constexpr std::array<std::pair<const char*, std::size_t>, 17> kArguments{{{"VV", 0},
                                                                          {"PP", 0},
                                                                          {"II", 0},
                                                                          {"BM", 0},
                                                                          {"QT", 0},
                                                                          {"RS", 0},
                                                                          {"TM", 1},
                                                                          {"SS", 6},
                                                                          {"CR", 2},
                                                                          {"HS", 1},
                                                                          {"DB", 2},
                                                                          {"MD", 13},
                                                                          {"MS", 13},
                                                                          {"ME", 13},
                                                                          {"GD", 10},
                                                                          {"GS", 10},
                                                                          {"GE", 10}}};

/// Status of a command that is none, empty for one that is.
std::string shapeOf(const Command& command) {
  const auto* found = std::find_if(kArguments.begin(), kArguments.end(),
                                   [&](const auto& known) { return command.name() == known.first; });
  if (found == kArguments.end() || command.arguments().size() > found->second) return kUnknown;
  return command.arguments().size() < found->second ? kTooFew : "";
}

/// Status of a string that is none, empty for one that is.
std::string labelStatus(std::string_view label) {
  if (label.size() > kLabelLength) return "0G";
  const auto is_letter = [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
           std::string_view(" ._+@").find(c) != std::string_view::npos;
  };
  return label.empty() || std::all_of(label.begin() + 1, label.end(), is_letter) ? "" : "0H";
}

/// Status of the digits of a measurement, empty for good ones: C-42-03320B, 8.1.
std::string digitsStatus(std::string_view arguments) {
  struct Field {
    std::size_t at, length;
    const char* status;
  };
  constexpr std::array<Field, 5> kFields{
      {{0, 4, "01"}, {4, 4, "02"}, {8, 2, "03"}, {10, 1, "06"}, {11, 2, "07"}}};
  for (const Field& field : kFields) {
    if (field.at < arguments.size() && !isNumber(arguments.substr(field.at, field.length)))
      return field.status;
  }
  return "";
}

}  // namespace

Command::Command(std::string_view line) : echo(line), text(line.substr(0, line.find(';'))) {
  label = line.substr(text.size());
}

void Memory::darken() {
  laser = false;
  stream.reset();
  single.reset();
}

Memory fresh(const Model& model, const Faults& faults) {
  Memory memory;
  memory.protocol = faults.find("scip1") != nullptr ? 1 : model.protocol;
  memory.baud = model.baud;
  return memory;
}

std::string Commands::answer(std::string_view line, Memory& memory, std::uint32_t clock) const {
  const Command command(line);
  if (memory.protocol == 1) return answer11(command, memory);
  const std::string result = status(command, memory);
  if (memory.single && result == kGood && command.name().front() == 'G') return "";
  return reply(line, result, result == kGood ? body(command, memory, clock) : "");
}

std::string Commands::answer11(const Command& command, Memory& memory) const {
  std::string answer = std::string(command.echo) + '\n';
  if (command.text == "SCIP2.0") {
    memory.protocol = 2;
    return answer + "0\n\n";
  }
  if (command.echo != "V" || model_.version_11.empty()) return answer + "E\n\n";
  answer += "0\n";
  for (const auto& [key, value] : model_.version_11)
    answer.append(key).append(":").append(value).append("\n");
  return answer + "\n";
}

std::string Commands::status(const Command& command, Memory& memory) const {
  const std::string name(command.name());
  if (std::string label = labelStatus(command.label); !label.empty()) return label;
  if (const auto refused = model_.refused.find(name); refused != model_.refused.end()) return refused->second;
  if (std::string shape = shapeOf(command); !shape.empty()) return shape;
  if (memory.adjusting && name != "TM" && name != "RS" && name != "QT") return kAdjusting;
  if (name[0] == 'M' || name[0] == 'G') return measure(command, memory);
  if (name == "BM" && faults_.find("bm01") != nullptr) return "01";
  if (name == "RS") memory = afterReset(memory, model_);
  return setting(name, command.arguments(), model_, memory);
}

std::string Commands::measure(const Command& command, Memory& memory) const {
  const bool is_intensity = command.text[1] == 'E';
  if (faults_.find("md0e") != nullptr || (is_intensity && faults_.find("no-me") != nullptr)) return kUnknown;
  if (std::string wrong = digitsStatus(command.arguments()); !wrong.empty()) return wrong;
  const std::optional<scip::Request> request = scip::request(command.text);
  if (!request) return kUnknown;
  if (request->last > model_.end_step) return "04";
  if (request->last < request->first) return "05";
  if (memory.broken) return kBroken;
  if (!request->stream && !memory.laser) return kLaserOff;
  memory.laser = true;
  (request->stream ? memory.stream : memory.single) =
      Order{*request, std::string(command.text), std::string(command.label)};
  return kGood;
}

std::string Commands::body(const Command& command, const Memory& memory, std::uint32_t clock) const {
  if (command.name() == "VV") return versionBody();
  if (command.name() == "PP") return parametersBody();
  if (command.name() == "II") return stateBody(memory, clock);
  return command.text == "TM1" ? summed(scip::encode(clock, kClockWidth)) : "";
}

std::string Commands::versionBody() const {
  const bool is_wrong = model_.bad_serial_sum || faults_.find("vv-badsum") != nullptr;
  std::string lines;
  for (const auto& [key, value] : model_.version) {
    std::string line = keyedLine(key, value);
    char& sum = line[line.size() - 2];
    // one more; five less would be the sum with the semicolon, which some clients take, too
    if (is_wrong && key == "SERI") sum = sum == 'o' ? '0' : static_cast<char>(sum + 1);
    lines += line;
  }
  return lines;
}

std::string Commands::parametersBody() const {
  const bool is_crossed = faults_.find("pp-crossed") != nullptr;
  std::string lines;
  for (const auto& [key, value] : model_.parameters) {
    std::string said = value;
    if (key == "ARES" && faults_.find("pp-ares0") != nullptr) said = "0";
    if (key == "AMIN" && is_crossed) said = std::to_string(parameters_.last);
    if (key == "AMAX" && is_crossed) said = std::to_string(parameters_.first);
    lines += keyedLine(key, said);
  }
  return lines;
}

std::string Commands::stateBody(const Memory& memory, std::uint32_t clock) const {
  std::array<char, 8> time{};
  std::snprintf(time.data(), time.size(), "%06X", clock);
  const bool is_ill = memory.broken || memory.ill;
  const std::array<std::pair<std::string, std::string>, 6> truth{{
      {"{laser}", memory.laser ? model_.laser_on : model_.laser_off},
      {"{mode}", memory.laser ? model_.measuring : model_.idle},
      {"{rpm}", std::to_string(motorSpeed(parameters_, memory))},
      {"{baud}", std::to_string(memory.baud)},
      {"{time}", time.data()},
      {"{health}", is_ill ? model_.ill : model_.healthy},
  }};
  std::string lines;
  for (auto [key, value] : model_.state) {
    for (const auto& [mark, now] : truth) {
      if (const std::size_t at = value.find(mark); at != std::string::npos)
        value.replace(at, mark.size(), now);
    }
    lines += keyedLine(key, value);
  }
  return lines;
}

}  // namespace kurumaisu::virtual_urg
