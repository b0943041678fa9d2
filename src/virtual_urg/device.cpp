// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/device.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "virtual_urg/settings.h"
#include "virtual_urg/state.h"

namespace kurumaisu::virtual_urg {
namespace {

constexpr std::size_t kLongestLine = 128;  // [bytes]; the longest command has 32
constexpr std::size_t kMostWaiting = 16;   // commands behind one that waits for a rotation
constexpr int kMostSteps = 10000;          // in four digits
constexpr double kMilliseconds = 1000;
constexpr double kClockPeriod = 1 << 24;  // [ms]
constexpr double kClockSlack = 1e-3;      // [ms] or 0.3 s would be 299 ms
constexpr const char* kBufferShort = "0B";

void require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument(what);
}

Model checkedModel(Model model) {
  const scip::Parameters parameters = parametersOf(model.parameters);
  const auto& bauds = model.bauds;
  require(model.end_step >= parameters.last && model.end_step < kMostSteps,
          "end_step must lie between AMAX and 9999: " + std::to_string(model.end_step));
  require(model.protocol == 1 || model.protocol == 2,
          "protocol must be 1 or 2: " + std::to_string(model.protocol));
  require(model.baud == 0 || std::find(bauds.begin(), bauds.end(), model.baud) != bauds.end(),
          "baud is not one of bauds: " + std::to_string(model.baud));
  require(model.boot_time >= 0, "boot_time must not be negative: " + std::to_string(model.boot_time));
  require(model.output_delay >= 0,
          "output_delay must not be negative: " + std::to_string(model.output_delay));
  for (const auto& [command, status] : model.refused) {
    require(
        command.size() == 2 && status.size() == 2,
        "refused: two letters and a status of two characters: " + std::string(command).append(": ") + status);
  }
  return model;
}

bool endsWaiting(std::string_view line) { return line.substr(0, 2) == "QT" || line.substr(0, 2) == "RS"; }

/// Status 00, or 0 in SCIP 1.1.
bool isGood(std::string_view answer, std::size_t echo) {
  const std::string_view status = answer.substr(echo + 1, 2);
  return status == "00" || status == "0\n";
}

}  // namespace

Device::State::State(Model kind, std::vector<Fault> all)
    : model(checkedModel(std::move(kind))),
      parameters(parametersOf(model.parameters)),
      faults(std::move(all)) {}

std::uint32_t Device::State::clockAt(double time) const {
  const double total = clock.start + (time - clock_zero) * kMilliseconds * (1 + clock.drift) + kClockSlack;
  return static_cast<std::uint32_t>(std::fmod(std::max(std::floor(total), 0.0), kClockPeriod));
}

double Device::State::scanTime() const { return 60.0 / motorSpeed(parameters, memory); }

bool Device::State::isDeaf(double now) const {
  return faults.find("blackhole") != nullptr || now < deaf_until;
}

void Device::State::restartClock(double now) {
  clock.start = 0;
  clock_zero = now;
}

void Device::State::powerUp(double now, double boot_time) {
  memory = fresh(model, faults);
  waiting.clear();
  input.clear();
  restartClock(now);
  deaf_until = now + boot_time;
}

void Device::State::hear(const std::string& line, double now, Output& output) {
  ++counts.commands;
  const Fault* deaf = faults.find("vv-deaf");
  if (deaf != nullptr && line == "VV" && ++versions > 1) {
    deaf_until = now + *deaf->value;
    versions = 0;
  }
  if (isDeaf(now)) return;
  const bool is_repeated = !heard.insert(line.substr(0, 2)).second;
  const bool is_full = waiting.size() >= kMostWaiting && !endsWaiting(line);
  if (line.size() > kLongestLine || is_repeated || is_full) {
    ++counts.refused;
    const std::string echo = line.substr(0, kLongestLine);
    output.bytes += memory.protocol == 1 ? echo + "\nE\n\n" : reply(echo, kBufferShort);
  } else if (memory.single && !endsWaiting(line)) {
    waiting.push_back(line);
  } else {
    carryOut(line, now, output);
  }
}

void Device::State::carryOut(const std::string& line, double now, Output& output) {
  const std::string answer = commands.answer(line, memory, clockAt(now));
  if (endsWaiting(line) && !memory.single) waiting.clear();
  if (std::exchange(memory.restarts_clock, false)) restartClock(now);
  if (!answer.empty() && !isGood(answer, line.size())) ++counts.refused;
  output.bytes += answer;
  if (faults.find("rst-after-cmd", static_cast<int>(counts.commands)) != nullptr)
    output.event = Event::kReset;
}

Device::Device(Model model, std::vector<Fault> faults, const Clock& clock, double now)
    : state_(std::make_unique<State>(std::move(model), std::move(faults))) {
  state_->clock = clock;
  if (const Fault* t0 = state_->faults.find("t0"); t0 != nullptr) state_->clock.start = *t0->value;
  state_->clock_zero = now;
  state_->deaf_until = now;
}

Device::~Device() = default;
Device::Device(Device&&) noexcept = default;
Device& Device::operator=(Device&&) noexcept = default;

Output Device::connect(double /*now*/) {
  Output output;
  state_->versions = 0;
  const Fault* closes = state_->faults.find("close-on-accept");
  const auto number = static_cast<double>(++state_->connections);
  if (closes != nullptr && number <= closes->value.value_or(number)) output.event = Event::kClose;
  return output;
}

void Device::disconnect(double /*now*/) {
  state_->memory.darken();
  state_->waiting.clear();
  state_->input.clear();
}

Output Device::receive(std::string_view bytes, double now) {
  Output output;
  State& state = *state_;
  if (state.isDeaf(now)) {
    state.counts.lost_input += bytes.size();
    return output;
  }
  state.heard.clear();
  while (!bytes.empty() && output.event == Event::kNone) {
    const std::size_t end = std::min(bytes.find_first_of("\r\n"), bytes.size());
    // One byte more than a line may have, to know that it is too long.
    const std::size_t taken = std::min(end, kLongestLine + 1 - state.input.size());
    state.input += bytes.substr(0, taken);
    state.counts.lost_input += end - taken;
    if (end == bytes.size()) break;
    bytes.remove_prefix(end + 1);
    if (!state.input.empty()) state.hear(std::exchange(state.input, ""), now, output);
  }
  return output;
}

void Device::powerCycle(double now) { state_->powerUp(now, state_->model.boot_time); }

bool Device::wantsScan() const { return state_->memory.stream || state_->memory.single; }

double Device::scanTime() const { return state_->scanTime(); }

double Device::readyAfter() const {
  const scip::Parameters& parameters = state_->parameters;
  return scanTime() * parameters.last / parameters.steps_per_turn + state_->model.output_delay;
}

int Device::baud() const { return state_->memory.baud; }

bool Device::hasStrictBaud() const { return state_->faults.find("strict-baud") != nullptr; }

bool Device::isBlackHole() const { return state_->faults.find("blackhole") != nullptr; }

std::uint32_t Device::clock(double now) const { return state_->clockAt(now); }

const Model& Device::model() const { return state_->model; }

const Counts& Device::counts() const { return state_->counts; }

}  // namespace kurumaisu::virtual_urg
