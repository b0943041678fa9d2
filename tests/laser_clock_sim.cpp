// SPDX-License-Identifier: BSD-3-Clause
// How wrong stamps are, by way and method: lines of words and numbers for scripts/bench laser_clock.
// laser_clock_sim SEEDS SECONDS START: of each sensor; its clock's first reading [ms].
#include "laser_clock_sim.h"

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "laser/clock.h"

namespace sim = laser_clock_sim;
namespace l = kurumaisu::laser;

namespace {

constexpr double kDriftMost = 0.002;  // [s/s]
constexpr std::array<double, 5> kUntil{1, 5, 20, 60,
                                       1e9};  // [s] since the first scan; a class of errors each
constexpr int kQuestions = 10;
constexpr double kQuestionEach = 0.02;  // [s]

/// Host's time of a scan by its clock [ms] and first byte [s].
using Method = std::function<double(std::uint32_t, double)>;

using Maker = Method (*)(sim::Sensor&);

Method envelope(sim::Sensor& /*sensor*/) {
  auto clock = std::make_shared<l::DeviceClock>(l::TimeMode::kEnvelope);
  return
      [clock](std::uint32_t ms, double first_byte) { return clock->stamp(ms, first_byte, sim::kLeastDelay); };
}

Method calibrated(sim::Sensor& sensor) {
  auto clock = std::make_shared<l::DeviceClock>(l::TimeMode::kEnvelope);
  for (int i = kQuestions; i > 0; --i) {
    const sim::Answer answer = sensor.ask(1 + i * kQuestionEach);
    clock->calibrate(answer.clock, answer.sent, answer.received);
  }
  return
      [clock](std::uint32_t ms, double first_byte) { return clock->stamp(ms, first_byte, sim::kLeastDelay); };
}

/// What one can do without the sensor's clock.
Method arrival(sim::Sensor& /*sensor*/) {
  return [](std::uint32_t /*ms*/, double first_byte) { return first_byte - sim::kLeastDelay; };
}

/// MRPT 2.5.8: ten scans by their arrival, from then on the sensor's clock, unsigned, without drift or wrap. Lent the
/// least delay, of which it does not know.
Method mrpt(sim::Sensor& /*sensor*/) {
  struct Start {
    int scans = 0;
    std::uint32_t clock = 0;
    double host = 0;
  };
  auto start = std::make_shared<Start>();
  return [start](std::uint32_t ms, double first_byte) {
    if (start->scans == 10) return start->host + 1e-3 * (ms - start->clock);
    *start = {start->scans + 1, ms, first_byte - sim::kLeastDelay};
    return start->host;
  };
}

std::vector<sim::Errors> errors(const sim::Way& way, Maker method, int seeds, double seconds, double start) {
  std::vector<sim::Errors> result(kUntil.size());
  for (int seed = 0; seed < seeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed));
    const double drift = std::uniform_real_distribution<double>(-kDriftMost, kDriftMost)(random);
    sim::Sensor sensor(way, drift, start, 1.7e9, static_cast<unsigned>(seed));
    const Method stamp = method(sensor);
    std::size_t k = 0;
    for (int i = 0; i * sim::kScanTime < seconds; ++i) {
      const sim::Arrival scan = sensor.next();
      while (i * sim::kScanTime >= kUntil[k]) ++k;
      result[k].add(stamp(scan.clock, scan.first_byte) - scan.truth);
    }
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: laser_clock_sim SEEDS SECONDS START\n");
    return 2;
  }
  const std::vector<std::pair<const char*, sim::Way>> ways{
      {"tcp", sim::kTcp}, {"usb", sim::kUsb}, {"polled", sim::kPolled}, {"busy", sim::kBusy}};
  const std::vector<std::pair<const char*, Maker>> methods{
      {"envelope", envelope}, {"calibrated", calibrated}, {"arrival", arrival}, {"mrpt", mrpt}};
  for (const auto& [way_name, way] : ways) {
    for (const auto& [name, method] : methods) {
      std::printf("%s %s", way_name, name);
      for (const sim::Errors& e :
           errors(way, method, std::atoi(argv[1]), std::atof(argv[2]), std::atof(argv[3]))) {
        std::printf(" %.3f %.3f %.3f", 1e3 * e.bias(), 1e3 * e.sd(), 1e3 * e.worst());
      }
      std::printf("\n");
    }
  }
  return 0;
}
