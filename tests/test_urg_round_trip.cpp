// SPDX-License-Identifier: BSD-3-Clause
// What is set in the virtual sensor is what the driver's decoder reads, beam by beam, in every encoding.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "scip/message.h"
#include "scip/request.h"
#include "scip/scan.h"
#include "scip/sensor.h"
#include "sensor_file.h"
#include "virtual_urg/device.h"
#include "virtual_urg/frames.h"

namespace test_urg_round_trip {

namespace s = kurumaisu::scip;
namespace v = kurumaisu::virtual_urg;

namespace {

constexpr int kMost = (1 << 18) - 1;       // in three characters
constexpr int kMostShort = (1 << 12) - 1;  // in two
constexpr s::Form kForms[] = {s::Form::kDistance, s::Form::kShort, s::Form::kIntensity};

/// A sensor with a client that reads what it sends.
class Bench {
 public:
  explicit Bench(const std::string& name)
      : model_(v::modelOf(SOURCE_DIR "/launch/urg/" + name + ".yaml")),
        fan_(v::parametersOf(model_.parameters)),
        device_(model_, {}, {}, 0) {
    if (model_.protocol == 1) say("SCIP2.0");
  }

  const v::Model& model() const { return model_; }
  const s::Parameters& fan() const { return fan_; }
  bool has(const s::Request& request) const {
    return model_.refused.count(s::command(request).substr(0, 2)) == 0;
  }
  std::size_t steps() const {
    return static_cast<std::size_t>(fan_.last) - static_cast<std::size_t>(fan_.first) + 1;
  }

  std::vector<s::Message> say(const std::string& command) {
    return read(device_.receive(command + "\n", now_));
  }

  std::vector<s::Message> turn(v::Measurement measurement) {
    measurement.start = now_;
    clock_ = device_.clock(now_);
    now_ += device_.scanTime();
    return read(device_.measure(measurement, now_));
  }

  /// The scan that answers a request. Only the first rotation after it is sent.
  s::Rotation scanOf(const s::Request& request, const v::Measurement& measurement) {
    if (!request.stream) say("BM");  // QT put the light out
    say(s::command(request));
    const std::vector<s::Message> messages = turn(measurement);
    if (messages.size() != 1) throw std::runtime_error(s::command(request) + ": no scan");
    s::Rotation scan = s::decodeScan(messages[0], request);
    EXPECT_EQ(scan.clock, clock_);
    if (request.stream) say("QT");
    return scan;
  }

 private:
  std::vector<s::Message> read(const v::Output& output) {
    assembler_.add(output.bytes, now_);
    std::vector<s::Message> messages;
    while (auto message = assembler_.next()) messages.push_back(*message);
    return messages;
  }

  v::Model model_;
  s::Parameters fan_;
  v::Device device_;
  s::Assembler assembler_;
  std::uint32_t clock_ = 0;
  double now_ = 1;
};

/// What is sent of each step from 0 on, in [mm] or as a code.
std::vector<int> sentOf(const Bench& bench, const std::vector<double>& ranges) {
  const v::Codes& codes = bench.model().codes;
  std::vector<int> sent(static_cast<std::size_t>(bench.model().end_step) + 1, codes.outside);
  for (std::size_t k = 0; k < ranges.size(); ++k) {
    int& value = sent[static_cast<std::size_t>(bench.fan().first) + k];
    if (std::isnan(ranges[k])) {
      value = codes.error;
    } else if (ranges[k] * 1000 > bench.fan().distance_max + 0.5) {
      value = codes.no_return;
    } else {
      value = static_cast<int>(std::floor(ranges[k] * 1000 + 0.5));
      if (value < bench.fan().distance_min) value = codes.too_near;
    }
  }
  return sent;
}

/// The step of each beam: the nearest valid one of its cluster, the first of those; else the cluster's first.
std::vector<std::size_t> speakersOf(const s::Request& request, const std::vector<int>& sent, int least) {
  std::vector<std::size_t> speakers;
  for (int from = request.first; from <= request.last; from += request.cluster) {
    std::vector<std::size_t> valid;
    for (int step = from; step < from + request.cluster && step <= request.last; ++step) {
      if (sent[static_cast<std::size_t>(step)] >= least) valid.push_back(static_cast<std::size_t>(step));
    }
    const auto nearer = [&](std::size_t a, std::size_t b) { return sent[a] < sent[b]; };
    speakers.push_back(valid.empty() ? static_cast<std::size_t>(from)
                                     : *std::min_element(valid.begin(), valid.end(), nearer));
  }
  return speakers;
}

/// Ranges of all kinds [m], and intensities.
v::Measurement drawn(const Bench& bench, unsigned seed) {
  std::mt19937 random(seed);
  v::Measurement measurement;
  for (std::size_t k = 0; k < bench.steps(); ++k) {
    double range =
        1e-3 * static_cast<double>(random() % static_cast<unsigned>(bench.fan().distance_max + 200));
    if (random() % 8 == 0) range = std::numeric_limits<double>::quiet_NaN();
    if (random() % 8 == 0) range = std::numeric_limits<double>::infinity();
    measurement.ranges.push_back(range);
    measurement.intensities.push_back(static_cast<double>(random() % (kMost + 1)));
  }
  return measurement;
}

/// Asks for a scan and compares each beam with what was set.
void expectScan(Bench& bench, const s::Request& request, const v::Measurement& measurement) {
  const s::Rotation scan = bench.scanOf(request, measurement);
  const std::vector<int> sent = sentOf(bench, measurement.ranges);
  const std::vector<std::size_t> speakers = speakersOf(request, sent, bench.fan().distance_min);
  ASSERT_EQ(scan.distances.size(), speakers.size()) << s::command(request);
  ASSERT_EQ(scan.intensities.size(), request.form == s::Form::kIntensity ? speakers.size() : 0);
  for (std::size_t beam = 0; beam < speakers.size(); ++beam) {
    const int most = request.form == s::Form::kShort ? kMostShort : kMost;
    ASSERT_EQ(scan.distances[beam], std::min(sent[speakers[beam]], most))
        << s::command(request) << " beam " << beam;
    if (scan.intensities.empty()) continue;
    const std::size_t index = speakers[beam] - static_cast<std::size_t>(bench.fan().first);  // wraps below it
    const double intensity = index < measurement.intensities.size() ? measurement.intensities[index] : 0;
    ASSERT_EQ(scan.intensities[beam], intensity) << s::command(request) << " beam " << beam;
  }
}

class UrgRoundTrip : public testing::TestWithParam<const char*> {
 protected:
  /// In every encoding that the sensor has, streamed and once.
  template <typename Action>
  void inEveryForm(Action action) {
    int count = 0;
    for (const s::Form form : kForms) {
      for (const bool stream : {true, false}) {
        const s::Request request{stream, form, bench.fan().first, bench.fan().last, 1, 0, 0};
        if (!bench.has(request)) continue;
        action(request);
        ++count;
      }
    }
    EXPECT_GE(count, 2);
  }

  Bench bench{GetParam()};
};

}  // namespace

TEST_P(UrgRoundTrip, EveryCluster) {
  inEveryForm([&](s::Request request) {
    for (request.cluster = 1; request.cluster <= 99; ++request.cluster)
      expectScan(bench, request, drawn(bench, static_cast<unsigned>(request.cluster)));
  });
}

TEST_P(UrgRoundTrip, EveryEndOfTheWindow) {
  const v::Measurement measurement = drawn(bench, 1);
  inEveryForm([&](s::Request request) {
    for (int step = 0; step <= bench.model().end_step; step += request.stream ? 1 : 7) {
      for (const auto& [first, last] :
           {std::pair(step, step), std::pair(0, step), std::pair(step, bench.model().end_step)}) {
        request.first = first;
        request.last = last;
        request.cluster = 1 + step % 3;
        expectScan(bench, request, measurement);
      }
    }
  });
}

TEST_P(UrgRoundTrip, EveryNumber) {
  inEveryForm([&](const s::Request& request) {
    const int most = request.form == s::Form::kShort ? kMostShort : kMost;
    for (int number = 0; number <= most;) {
      v::Measurement measurement;
      for (std::size_t k = 0; k < bench.steps(); ++k) {
        measurement.codes.push_back(std::min(number++, most));
        measurement.intensities.push_back(most - measurement.codes.back());
      }
      const s::Rotation scan = bench.scanOf(request, measurement);
      ASSERT_EQ(scan.distances, measurement.codes) << s::command(request);
      for (std::size_t k = 0; k < scan.intensities.size(); ++k)
        ASSERT_EQ(scan.intensities[k], measurement.intensities[k]);
    }
  });
}

TEST_P(UrgRoundTrip, EveryMillimetre) {
  const s::Request request{true, s::Form::kDistance, bench.fan().first, bench.fan().last, 1, 0, 0};
  for (int distance = bench.fan().distance_min; distance <= bench.fan().distance_max;) {
    v::Measurement measurement;
    std::vector<int> expected;
    for (std::size_t k = 0; k < bench.steps(); ++k) {
      expected.push_back(std::min(distance++, bench.fan().distance_max));
      measurement.ranges.push_back(1e-3 * expected.back());
    }
    ASSERT_EQ(bench.scanOf(request, measurement).distances, expected);
  }
}

TEST_P(UrgRoundTrip, CountedAndLeftOut) {
  const s::Request request{true, s::Form::kDistance, bench.fan().first, bench.fan().last, 1, 2, 12};
  ASSERT_EQ(bench.say(s::command(request) + ";a string").size(), 1U);
  int left = request.count;
  for (unsigned turn = 0; turn < 60; ++turn) {
    const v::Measurement measurement = drawn(bench, turn);
    const std::vector<s::Message> messages = bench.turn(measurement);
    ASSERT_EQ(messages.size(), turn % 3 == 0 && left > 0 ? 1U : 0U) << turn;
    if (messages.empty()) continue;
    --left;
    EXPECT_EQ(messages[0].command.substr(13), (left < 10 ? "0" : "") + std::to_string(left) + ";a string");
    const std::vector<int> sent = sentOf(bench, measurement.ranges);
    EXPECT_TRUE(std::equal(sent.begin() + request.first, sent.begin() + request.last + 1,
                           s::decodeScan(messages[0], request).distances.begin()));
  }
  EXPECT_EQ(left, 0);
}

INSTANTIATE_TEST_SUITE_P(Sensors, UrgRoundTrip, testing::Values("urg_04lx", "urg_04lx_ug01", "utm_30lx"));

}  // namespace test_urg_round_trip
