// SPDX-License-Identifier: BSD-3-Clause
#include "laser/calibrate.h"

#include <cstdint>
#include <optional>
#include <string>

#include "scip/code.h"
#include "scip/scan.h"

namespace kurumaisu::laser {
namespace {

constexpr int kTimes = 10;

/// The clock [ms] in a reply to TM1, if it can be relied on.
std::optional<std::uint32_t> timeIn(const scip::Message& reply) try {
  if (reply.status != "00" || reply.bad_sums > 0 || reply.lines.size() != 1) return std::nullopt;
  return scip::decodeClock(reply.lines[0]);
} catch (const scip::BadFrame&) {
  return std::nullopt;
}

}  // namespace

void calibrate(Link& link, DeviceClock& clock, const std::function<double()>& now, double answer_timeout,
               const Tell& tell) {
  clock.restart();
  const std::string status = link.ask("TM0", answer_timeout).status;
  int heard = 0;
  for (int i = 0; status == "00" && i < kTimes; ++i) {
    const double sent = now();
    const scip::Message reply = link.ask("TM1", answer_timeout);
    if (const std::optional<std::uint32_t> time = timeIn(reply)) {
      clock.calibrate(*time, sent, reply.first_byte);
      ++heard;
    }
  }
  link.ask("TM2", answer_timeout);
  if (heard > 0) return;
  tell(Report::Level::kWarning, "LASER_NO_CALIBRATION: the sensor does not tell its time (TM0: status " +
                                    status + "); calibrate_time has no effect");
}

}  // namespace kurumaisu::laser
