// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/settings.h"

#include <algorithm>
#include <cmath>

#include "virtual_urg/statuses.h"

namespace kurumaisu::virtual_urg {
namespace {

// Statuses as C-42-03320B lists them, 8.3 to 8.10.
constexpr int kSlowest = 10;       // of CR; each is 1 % less
constexpr int kInitialSpeed = 99;  // of CR
constexpr double kPercent = 0.01;

int valueOf(std::string_view digits) { return std::stoi(std::string(digits)); }

std::string light(Memory& memory) {
  if (memory.broken) return "01";
  if (memory.laser) return "02";
  memory.laser = true;
  return kGood;
}

std::string adjust(std::string_view argument, Memory& memory) {
  if (argument == "0") {
    if (memory.adjusting) return "02";
    memory.darken();
    memory.adjusting = true;
    return kGood;
  }
  if (argument == "1") return memory.adjusting ? kGood : "04";
  if (argument != "2") return "01";
  if (!memory.adjusting) return "03";
  memory.adjusting = false;
  return kGood;
}

std::string setRate(std::string_view argument, const Model& model, Memory& memory) {
  if (!isNumber(argument)) return "01";
  const int baud = valueOf(argument);
  if (std::find(model.bauds.begin(), model.bauds.end(), baud) == model.bauds.end()) return "02";
  if (baud == memory.baud) return "03";
  memory.baud = baud;
  return kGood;
}

std::string setSpeed(std::string_view argument, Memory& memory) {
  if (!isNumber(argument)) return "01";
  const int asked = valueOf(argument);
  if (asked > kSlowest && asked != kInitialSpeed) return "02";
  const int slowness = asked == kInitialSpeed ? 0 : asked;
  if (slowness == memory.slowness) return "03";
  memory.slowness = slowness;
  return kGood;
}

std::string setSensitivity(std::string_view argument, Memory& memory) {
  if (argument != "0" && argument != "1") return "01";
  const bool sensitive = argument == "1";
  if (sensitive == memory.sensitive) return "02";
  memory.sensitive = sensitive;
  return kGood;
}

std::string pretend(std::string_view argument, Memory& memory) {
  constexpr int kEnd = 10;
  const int asked = isNumber(argument) ? valueOf(argument) : 0;
  if (asked == kEnd) {
    if (memory.play == Play::kNone) return "03";
    memory.play = Play::kNone;
    memory.broken = false;
    return kGood;
  }
  if (asked < 1 || asked > static_cast<int>(Play::kFailsAtOnce)) return "01";
  const auto play = static_cast<Play>(asked);
  if (play == memory.play) return "02";
  memory.play = play;
  if (play == Play::kBroken11 || play == Play::kBroken20) {
    memory.darken();
    memory.broken = true;
  }
  return kGood;
}

}  // namespace

bool isNumber(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

int motorSpeed(const scip::Parameters& parameters, const Memory& memory) {
  return static_cast<int>(std::lround(parameters.rpm * (1 - kPercent * memory.slowness)));
}

Memory afterReset(const Memory& memory, const Model& model) {
  Memory result;
  result.protocol = memory.protocol;
  result.baud = model.baud;
  result.restarts_clock = true;
  return result;
}

std::string setting(std::string_view name, std::string_view argument, const Model& model, Memory& memory) {
  if (name == "BM") return light(memory);
  if (name == "QT") memory.darken();
  if (name == "TM") return adjust(argument, memory);
  if (name == "SS") return setRate(argument, model, memory);
  if (name == "CR") return setSpeed(argument, memory);
  if (name == "HS") return setSensitivity(argument, memory);
  if (name == "DB") return pretend(argument, memory);
  return kGood;
}

}  // namespace kurumaisu::virtual_urg
