// SPDX-License-Identifier: BSD-3-Clause
#include "scip/sensor.h"

#include <charconv>
#include <cmath>

#include "scip/code.h"

namespace kurumaisu::scip {
namespace {

using Values = std::map<std::string, std::string>;

struct Limits {
  int least;
  int most;
};

// What the protocol itself can say: a distance has three characters of six bits, a step of a command four digits, and
// the clock ticks in milliseconds.
constexpr Limits kNearest{0, (1 << 18) - 1};   // [mm]
constexpr Limits kFarthest{1, (1 << 18) - 1};  // [mm]
constexpr Limits kStep{0, 9999};
constexpr Limits kSteps{1, 10000};  // of a turn
constexpr Limits kSpeed{1, 60000};  // [1/min]

std::string textOf(const Values& values, const std::string& key) {
  const auto found = values.find(key);
  if (found == values.end()) throw BadFrame("PP: " + key + " is missing");
  return found->second;
}

int numberOf(const Values& values, const std::string& key, const Limits& limits) {
  const std::string text = textOf(values, key);
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_number = error == std::errc() && end == text.data() + text.size();
  if (!is_number || value < limits.least || value > limits.most) {
    throw BadFrame("PP: " + key + " must be a whole number from " + std::to_string(limits.least) + " to " +
                   std::to_string(limits.most) + ": " + text);
  }
  return value;
}

void require(bool holds, const std::string& what) {
  if (!holds) throw BadFrame("PP: " + what);
}

}  // namespace

double Parameters::increment() const { return 2 * M_PI / steps_per_turn; }

double Parameters::bearing(int step) const { return (step - front) * increment(); }

double Parameters::scanTime() const { return 60 / rpm; }

double Parameters::stepTime() const { return scanTime() / steps_per_turn; }

Values keyed(const Message& message) {
  Values values;
  for (const std::string& line : message.lines) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos) continue;
    const std::size_t end = line.back() == ';' ? line.size() - 1 : line.size();
    if (end > colon) values[line.substr(0, colon)] = line.substr(colon + 1, end - colon - 1);
  }
  return values;
}

Parameters parameters(const Message& message) {
  const Values values = keyed(message);
  Parameters result;
  result.model = textOf(values, "MODL");
  result.distance_min = numberOf(values, "DMIN", kNearest);
  result.distance_max = numberOf(values, "DMAX", kFarthest);
  result.steps_per_turn = numberOf(values, "ARES", kSteps);
  result.first = numberOf(values, "AMIN", kStep);
  result.last = numberOf(values, "AMAX", kStep);
  result.front = numberOf(values, "AFRT", kStep);
  result.rpm = numberOf(values, "SCAN", kSpeed);
  require(result.first <= result.last,
          "AMIN " + std::to_string(result.first) + " is above AMAX " + std::to_string(result.last));
  require(
      result.last - result.first < result.steps_per_turn,
      "AMIN to AMAX are more than the " + std::to_string(result.steps_per_turn) + " steps of a turn (ARES)");
  require(result.front <= result.steps_per_turn,
          "AFRT " + std::to_string(result.front) + " lies beyond a turn");
  require(result.distance_min < result.distance_max, "DMIN " + std::to_string(result.distance_min) +
                                                         " is not below DMAX " +
                                                         std::to_string(result.distance_max));
  return result;
}

}  // namespace kurumaisu::scip
