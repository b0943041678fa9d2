// SPDX-License-Identifier: BSD-3-Clause
#include "laser/self_test.h"

#include <optional>

#include "laser/diagnosis.h"
#include "laser/port.h"

namespace kurumaisu::laser {
namespace {

constexpr double kPatience = 5;  // [s] for all of it
constexpr std::uint64_t kScans = 3;

}  // namespace

Verdict selfTest(Driver& driver, const DriverSettings& settings, const std::function<bool()>& wait) {
  const Counts before = driver.status().counts;
  std::optional<Counts> begun;  // with the first scan after the restart, which itself costs some
  Status status;
  driver.restart();
  for (const double deadline = steadyTime() + kPatience; wait() && steadyTime() < deadline;) {
    status = driver.status();
    const bool is_new = status.counts.attempts > before.attempts && status.counts.scans > before.scans;
    if (!begun && is_new && status.state == State::kStreaming) begun = status.counts;
    if (!begun || status.counts.scans < begun->scans + kScans) continue;
    const Diagnosis diagnosis = diagnoseDevice(status, *begun, settings, 0);
    return {diagnosis.level == Level::kOk, diagnosis.summary};
  }
  return {false, "No scans; " + diagnoseDevice(status, begun.value_or(before), settings, 0).summary};
}

}  // namespace kurumaisu::laser
