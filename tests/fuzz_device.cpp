// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer's target for the virtual sensor. An input is a story: its first two bytes choose the sensor and a fault;
// of the others some are events, all else is what a client sends. What comes out is read by the driver's decoder.
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <string>
#include <vector>

#include "fuzzing.h"
#include "scip/code.h"
#include "scip/message.h"
#include "virtual_urg/device.h"

namespace s = kurumaisu::scip;
namespace v = kurumaisu::virtual_urg;
using fuzzing::require;

namespace {

constexpr int kFirst = 3;
constexpr int kLast = 40;
constexpr int kEnd = 45;  // last step that may be asked for
constexpr int kNearest = 20;
constexpr int kOutside = 19;
constexpr std::size_t kReply = 1024;  // [bytes] at most, of a command that is no measurement and of its echo
constexpr std::size_t kKept = 64;     // rotations that are remembered

/// Those that spoil what is measured, rather than how it is sent, are left out.
constexpr std::array kFaults{"",
                             "corrupt",
                             "trunc",
                             "noend",
                             "badlf",
                             "garbage",
                             "dup@2",
                             "err50@2",
                             "err98",
                             "stall@2",
                             "close@2",
                             "stall@2=1",
                             "hangup@3=0.5",
                             "reboot@2",
                             "scip1",
                             "bm01",
                             "md0e",
                             "no-me",
                             "dribble",
                             "vv-badsum",
                             "vv-deaf=1",
                             "t-stands",
                             "blackhole",
                             "pp-ares0",
                             "pp-crossed",
                             "t0=16777200",
                             "strict-baud",
                             "rst-after-cmd",
                             "close-on-accept=1",
                             "garbage=300"};

v::Model modelOf(unsigned kind) {
  v::Model model;
  model.name = "small";
  model.version = {{"VEND", "a"}, {"PROD", "b"}, {"FIRM", "c"}, {"PROT", "d"}, {"SERI", "e"}};
  if (kind % 2 == 0) model.version_11 = model.version;
  model.parameters = {{"MODL", "small"}, {"DMIN", "20"}, {"DMAX", "5600"}, {"ARES", "64"},
                      {"AMIN", "3"},     {"AMAX", "40"}, {"AFRT", "32"},   {"SCAN", "600"}};
  model.state = {{"LASR", "{laser}"}, {"SCSP", "{rpm}"},  {"MESM", "{mode}"},
                 {"SBPS", "{baud}"},  {"TIME", "{time}"}, {"STAT", "{health}"}};
  model.laser_on = "ON";
  model.laser_off = "OFF";
  model.healthy = "well";
  model.ill = "ill";
  if (kind % 3 == 0) model.refused = {{"ME", "0E"}, {"GE", "0E"}};
  model.protocol = kind % 4 == 0 ? 1 : 2;
  model.baud = kind % 2 == 0 ? 19200 : 0;
  if (kind % 2 == 0) model.bauds = {19200, 115200};
  model.end_step = kEnd;
  model.codes = {0, 7, 7, kOutside};
  model.boot_time = 0.5;
  return model;
}

/// What was measured, for each step up to the last that may be asked for.
struct Truth {
  std::uint32_t clock;
  std::vector<int> distances;
  std::vector<int> intensities;
};

class Story {
 public:
  Story(unsigned kind, const std::string& fault, std::string received)
      : device_(modelOf(kind), fault.empty() ? std::vector<v::Fault>{} : std::vector{v::fault(fault)},
                {0, 1e-3}, 0),
        received_(std::move(received)),
        clock_stands_(fault == "t-stands") {}

  void tell() {
    std::string said;
    for (const char c : received_) {
      if (c > 0 && c < 9) {
        hear(said);
        said.clear();
        happen(c);
      } else {
        said += c;
      }
    }
    hear(said);
    require(device_.counts().refused <= device_.counts().commands, "more refused than heard");
  }

 private:
  void hear(const std::string& bytes) {
    if (bytes.empty()) return;
    const std::size_t commands =
        1 + static_cast<std::size_t>(
                std::count_if(bytes.begin(), bytes.end(), [](char c) { return c == '\n' || c == '\r'; }));
    take(device_.receive(bytes, now_), commands * kReply);
  }

  void happen(char event) {
    if (event == 1) measure(device_.scanTime());
    if (event == 2) now_ += 0.1;
    if (event == 3) device_.powerCycle(now_);
    if (event == 4) device_.disconnect(now_);
    if (event == 5) take(device_.connect(now_), 0);
    if (event == 6) now_ += 4000;
    if (event == 7) now_ *= 1.001;
    if (event == 8) measure(0);
  }

  void measure(double duration) {
    v::Measurement measurement;
    measurement.start = now_;
    Truth truth{clock_stands_ ? 0 : device_.clock(now_), std::vector<int>(kEnd + 1, kOutside),
                std::vector<int>(kEnd + 1, 0)};
    for (int step = kFirst; step <= kLast; ++step) {
      const int distance = static_cast<int>(dice_.roll(6000));
      const int intensity = static_cast<int>(dice_.roll(1U << 18U));
      measurement.ranges.push_back(step % 11 == 0 ? std::numeric_limits<double>::quiet_NaN()
                                                  : 1e-3 * distance);
      measurement.intensities.push_back(intensity);
      const auto at = static_cast<std::size_t>(step);
      truth.distances[at] = step % 11 == 0 || distance < kNearest ? 7 : distance > 5600 ? 0 : distance;
      truth.intensities[at] = intensity;
    }
    truths_.push_back(truth);
    if (truths_.size() > kKept) truths_.pop_front();
    now_ += duration;
    take(device_.measure(measurement, now_), 64 * kReply);
  }

  void take(const v::Output& output, std::size_t most) {
    require(output.bytes.size() <= most, "an answer out of proportion");
    require(output.spread >= 0 && output.away >= 0, "an event in the past");
    if (output.bytes.empty()) return;
    oracle_.add(output.bytes);
    assembler_.add(output.bytes, now_);
    while (const auto message = assembler_.next()) check(*message);
  }

  void check(const s::Message& message) {
    const auto request = s::request(message.command.substr(0, message.command.find(';')));
    if (!request) return;
    try {
      const s::Rotation rotation = s::decodeScan(message, *request);
      oracle_.check(message.command, rotation);
      checkTruth(rotation, *request);
    } catch (const s::BadFrame&) {
    }
  }

  /// The scan must be one of the rotations that were measured: of each cluster the nearest valid step, else the first.
  void checkTruth(const s::Rotation& rotation, const s::Request& request) {
    for (const Truth& truth : truths_) {
      if (truth.clock == rotation.clock && isIn(truth, rotation, request)) return;
    }
    require(false, "a scan that was not measured");
  }

  static bool isIn(const Truth& truth, const s::Rotation& rotation, const s::Request& request) {
    const int most = request.form == s::Form::kShort ? 4095 : (1 << 18) - 1;
    std::size_t beam = 0;
    for (int from = request.first; from <= request.last; from += request.cluster, ++beam) {
      int best = from;
      for (int step = from; step < from + request.cluster && step <= request.last; ++step) {
        const int there = truth.distances.at(static_cast<std::size_t>(step));
        const int least = truth.distances.at(static_cast<std::size_t>(best));
        if (there >= kNearest && (least < kNearest || there < least)) best = step;
      }
      const auto at = static_cast<std::size_t>(best);
      if (rotation.distances.at(beam) != std::min(truth.distances.at(at), most)) return false;
      if (!rotation.intensities.empty() && rotation.intensities.at(beam) != truth.intensities.at(at))
        return false;
    }
    return beam == rotation.distances.size();
  }

  v::Device device_;
  std::string received_;
  bool clock_stands_;  // where it is when the power comes
  s::Assembler assembler_;
  fuzzing::Oracle oracle_{""};
  std::deque<Truth> truths_;
  fuzzing::Dice dice_{1};
  double now_ = 1;
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  Story(data[0], kFaults[data[1] % kFaults.size()],
        std::string(reinterpret_cast<const char*>(data) + 2, size - 2))
      .tell();
  return 0;
}
