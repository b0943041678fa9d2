// SPDX-License-Identifier: BSD-3-Clause
// What a Device does at each turn of its mirror.
#include <utility>

#include "virtual_urg/damage.h"
#include "virtual_urg/state.h"
#include "virtual_urg/statuses.h"

namespace kurumaisu::virtual_urg {
namespace {

constexpr int kPlayFrom = 20;        // scans that DB lets pass before its part begins
constexpr int kTrouble = 50;         // from this status on the hardware is in trouble
constexpr double kDribble = 0.8;     // of a turn
constexpr const char* kData = "99";  // of a stream's
constexpr const char* kVerifying = "21";
constexpr const char* kResumed = "98";

/// Status of trouble, of which II tells.
bool isTrouble(const std::string& status) { return status >= std::to_string(kTrouble) && status < kResumed; }

/// The echo; a stream's counts down, in its last two digits.
std::string echoOf(const Order& order) {
  if (!order.request.stream || order.request.count == 0) return order.text + order.label;
  const std::string left = std::to_string(order.request.count - order.sent);
  return order.text.substr(0, order.text.size() - 2) + (left.size() < 2 ? "0" : "") + left + order.label;
}

}  // namespace

Output Device::measure(const Measurement& measurement, double now) {
  Output output;
  if (now < state_->deaf_until) return output;
  if (state_->memory.single) state_->answerSingle(measurement, now, output);
  if (state_->memory.stream && output.event == Event::kNone) state_->continueStream(measurement, now, output);
  return output;
}

void Device::State::answerSingle(const Measurement& measurement, double now, Output& output) {
  Order order = *std::exchange(memory.single, std::nullopt);
  send(order, measurement, now, output);
  while (!waiting.empty() && !memory.single && output.event == Event::kNone) {
    const std::string line = waiting.front();
    waiting.pop_front();
    carryOut(line, now, output);
  }
}

void Device::State::continueStream(const Measurement& measurement, double now, Output& output) {
  Order& order = *memory.stream;
  if (order.turns_left > 0) {
    --order.turns_left;
    return;
  }
  order.turns_left = order.request.interval;
  const bool is_last = order.sent + 1 == order.request.count;
  send(order, measurement, now, output);
  // C-42-03320B, 8.1: after the last one it switches the laser off.
  if (is_last && memory.stream) memory.darken();
}

void Device::State::send(Order& order, const Measurement& measurement, double now, Output& output) {
  const int scan = static_cast<int>(++counts.scans);
  ++order.sent;
  if (const Fault* stall = faults.find("stall", scan); stall != nullptr) {
    if (stall->value) {
      deaf_until = now + *stall->value;
    } else {
      memory.stream.reset();
    }
    return;
  }
  output.bytes += damaged(frame(order, measurement, scan), faults, scan);
  if (const Fault* dribble = faults.find("dribble", scan); dribble != nullptr)
    output.spread = dribble->value.value_or(kDribble * scanTime());
  if (memory.broken) memory.darken();
  strike(scan, now, output);
}

std::string Device::State::frame(const Order& order, const Measurement& measurement, int scan) {
  std::string status = statusAt(faults, scan);
  if (status.empty()) status = playedStatus(order);
  memory.ill = isTrouble(status);
  const std::string echo = echoOf(order);
  if (!status.empty()) return reply(echo, status);
  const double time = faults.find("t-stands") != nullptr ? clock_zero : measurement.start;
  const Steps steps = mismeasured(stepsOf(measurement, model, parameters), faults, scan);
  return reply(echo, order.request.stream ? kData : kGood,
               scanBody(order.request, clockAt(time), steps, parameters.distance_min));
}

std::string Device::State::playedStatus(const Order& order) {
  const bool is_long = order.request.stream && (order.request.count == 0 || order.request.count > kPlayFrom);
  const int act = order.sent - kPlayFrom;  // from 1
  if (!is_long || act < 1 || memory.play < Play::kRecovers) return "";
  if (memory.play == Play::kRecovers) return act == 1 ? kVerifying : act == 2 ? kResumed : "";
  if (memory.play == Play::kFails && act == 1) return kVerifying;
  memory.broken = true;
  return kBroken;
}

void Device::State::strike(int scan, double now, Output& output) {
  if (faults.find("close", scan) != nullptr) output.event = Event::kClose;
  if (faults.find("rst", scan) != nullptr) output.event = Event::kReset;
  if (const Fault* hangup = faults.find("hangup", scan); hangup != nullptr) {
    output.event = Event::kHangUp;
    output.away = hangup->value.value_or(0);
    powerUp(now, output.away);
  }
  if (const Fault* reboot = faults.find("reboot", scan); reboot != nullptr)
    powerUp(now, reboot->value.value_or(model.boot_time));
}

}  // namespace kurumaisu::virtual_urg
