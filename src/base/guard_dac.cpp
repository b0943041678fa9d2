// SPDX-License-Identifier: BSD-3-Clause
#include "base/guard_dac.h"

namespace kurumaisu {
namespace {

/// The rate for which a converter stands that was asked for a rate's voltage.
double heldRate(const AxisLaw& law, double held, double asked, double rate) {
  if (rate == 0 || held == asked) return rate;
  return AxisInverse(law).rate(held, rate > 0 ? 1 : -1);
}

std::string summaryOf(const guard::Status& status) {
  if (!status.connected && status.reason == guard::Reason::kBusy) return "neutral: " + nameOf(status.reason);
  if (!status.connected) return "no guard: the output of the converter is unknown";
  if (!status.has_device) return "the D/A converter is lost: its output is unknown";
  if (status.state == guard::State::kTripped)
    return "tripped: " + nameOf(status.reason) + ": release the input to arm again";
  return nameOf(status.state);
}

}  // namespace

Output GuardDac::put(const Output& asked) {
  const std::uint64_t late = client_.status().late;
  const guard::Status& status = client_.put({asked.translation, asked.steering, asked.reference});
  if (status.late > late) return held_;
  held_ = {status.volts.translation, status.volts.steering, status.volts.reference, 0, 0};
  if (status.state == guard::State::kArmed) {
    held_.v = heldRate(law_.translation, held_.translation, asked.translation, asked.v);
    held_.w = heldRate(law_.steering, held_.steering, asked.steering, asked.w);
  }
  return held_;
}

Report reportGuard(const guard::Status& status, const guard::Status& before, double now) {
  const bool is_lost = !status.connected || !status.has_device;
  const bool has_changed = status.trips > before.trips || status.late > before.late;
  return {
      status.state == guard::State::kTripped || has_changed,
      summaryOf(status),
      {{"connected", status.connected ? "yes" : "no"},
       {"state", nameOf(status.state)},
       {"reason", nameOf(status.reason)},
       {"trips since the guard's start", std::to_string(status.trips)},
       {"answers late", std::to_string(status.late)},
       {"connections", std::to_string(status.connections)},
       {"age of the last answer [s]", status.answered > 0 ? std::to_string(now - status.answered) : "none"}},
      is_lost};
}

}  // namespace kurumaisu
