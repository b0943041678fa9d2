// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/frames.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "scip/code.h"

namespace kurumaisu::virtual_urg {
namespace {

constexpr std::size_t kLineLength = 64;    // characters of data
constexpr std::size_t kStampWidth = 4;     // characters
constexpr std::size_t kDistanceWidth = 3;  // of a beam with intensity
constexpr double kMillimetres = 1000;
constexpr int kMost = (1 << 18) - 1;  // in three characters

void requireSize(const char* what, std::size_t size, std::size_t expected) {
  if (size == expected) return;
  throw std::invalid_argument(std::to_string(size) + " " + what + ", not " + std::to_string(expected) +
                              ": one for each step from AMIN to AMAX");
}

int distanceOf(double range, const Codes& codes, const scip::Parameters& parameters) {
  if (std::isnan(range)) return codes.error;
  const double distance = std::round(range * kMillimetres);
  if (distance < parameters.distance_min) return codes.too_near;
  return distance > parameters.distance_max ? codes.no_return : static_cast<int>(distance);
}

std::vector<int> distancesOf(const Measurement& measurement, const Codes& codes,
                             const scip::Parameters& parameters) {
  const auto count = static_cast<std::size_t>(parameters.last - parameters.first) + 1;
  if (!measurement.codes.empty()) {
    requireSize("codes", measurement.codes.size(), count);
    return measurement.codes;
  }
  requireSize("ranges", measurement.ranges.size(), count);
  std::vector<int> distances;
  distances.reserve(measurement.ranges.size());
  for (const double range : measurement.ranges) distances.push_back(distanceOf(range, codes, parameters));
  return distances;
}

std::vector<int> intensitiesOf(const Measurement& measurement, std::size_t count) {
  if (measurement.intensities.empty()) return std::vector<int>(count, 0);
  requireSize("intensities", measurement.intensities.size(), count);
  std::vector<int> intensities;
  intensities.reserve(measurement.intensities.size());
  for (const double value : measurement.intensities) {
    intensities.push_back(std::isnan(value) ? 0 : static_cast<int>(std::clamp(value, 0.0, double{kMost})));
  }
  return intensities;
}

/// The step that speaks for a cluster: the nearest one that has a distance, else the first.
std::size_t nearest(const std::vector<int>& distances, std::size_t from, std::size_t to, int distance_min) {
  std::size_t best = from;
  int least = std::numeric_limits<int>::max();
  for (std::size_t step = from; step <= to; ++step) {
    if (distances[step] < distance_min || distances[step] >= least) continue;
    best = step;
    least = distances[step];
  }
  return best;
}

std::string encoded(int value, std::size_t characters) {
  const int most = (1 << (6 * characters)) - 1;
  return scip::encode(static_cast<std::uint32_t>(std::clamp(value, 0, most)), characters);
}

}  // namespace

std::string summed(std::string_view line) {
  std::string text(line);
  text += scip::sum(line);
  return text + '\n';
}

std::string keyedLine(std::string_view key, std::string_view value) {
  std::string text(key);
  text += ':';
  text += value;
  const char sum = scip::sum(text);
  return text + ';' + sum + '\n';
}

std::string reply(std::string_view echo, std::string_view status, std::string_view body) {
  std::string text(echo);
  text += '\n';
  text += summed(status);
  text += body;
  return text + '\n';
}

scip::Parameters parametersOf(const Lines& lines) {
  scip::Message message;
  for (const auto& [key, value] : lines)
    message.lines.push_back(std::string(key).append(":").append(value).append(";"));
  try {
    return scip::parameters(message);
  } catch (const scip::BadFrame& error) {
    throw std::invalid_argument(error.what());
  }
}

Steps stepsOf(const Measurement& measurement, const Model& model, const scip::Parameters& parameters) {
  const std::vector<int> distances = distancesOf(measurement, model.codes, parameters);
  const std::vector<int> intensities = intensitiesOf(measurement, distances.size());
  const auto all = static_cast<std::size_t>(model.end_step) + 1;
  Steps steps{std::vector<int>(all, model.codes.outside), std::vector<int>(all, 0)};
  std::copy(distances.begin(), distances.end(), steps.distances.begin() + parameters.first);
  std::copy(intensities.begin(), intensities.end(), steps.intensities.begin() + parameters.first);
  return steps;
}

std::string scanBody(const scip::Request& request, std::uint32_t clock, const Steps& steps,
                     int distance_min) {
  const bool intense = request.form == scip::Form::kIntensity;
  const std::size_t width = intense ? kDistanceWidth : static_cast<std::size_t>(scip::width(request.form));
  std::string data;
  for (int from = request.first; from <= request.last; from += request.cluster) {
    const int to = std::min(from + request.cluster - 1, request.last);
    const std::size_t step =
        nearest(steps.distances, static_cast<std::size_t>(from), static_cast<std::size_t>(to), distance_min);
    data += encoded(steps.distances[step], width);
    if (intense) data += encoded(steps.intensities[step], kDistanceWidth);
  }
  std::string body = summed(scip::encode(clock, kStampWidth));
  for (std::size_t at = 0; at < data.size(); at += kLineLength)
    body += summed(std::string_view(data).substr(at, kLineLength));
  return body;
}

}  // namespace kurumaisu::virtual_urg
