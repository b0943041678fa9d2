// SPDX-License-Identifier: BSD-3-Clause
#include "laser/handshake.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <vector>

#include "scip/code.h"

namespace kurumaisu::laser {
namespace {

// A sensor answers QT in milliseconds, a USB converter adds 16 ms. Waiting is what a sensor that was reset costs.
constexpr double kProbeTimeout = 0.08;  // [s]
// A scan under way is sent to its end first: 185 ms for an URG-04LX at 115200 baud, where that is its rate.
constexpr double kBusyTimeout = 0.4;  // [s]
constexpr int kPowerUpBaud = 19200;
constexpr int kUsualBaud = 115200;  // urg_node, MRPT and others leave a sensor at
constexpr int kTries = 3;

enum class Voice { kNone, kScip1, kScip2 };

/// Quiets a sensor that may be deaf for a while, so that it is told again and again. What came at a wrong rate before may
/// spoil the first command: an answer that is no 00 counts the second time.
Voice quiet(Link& link, double timeout) {
  Voice voice = Voice::kNone;
  for (const double until = steadyTime() + timeout; steadyTime() < until;) {
    const auto reply = link.ask("QT", std::min(timeout, kProbeTimeout), kBusyTimeout);
    if (!reply) continue;
    if (reply->status.size() == 1) return Voice::kScip1;
    if (reply->status == "00" || voice == Voice::kScip2) return Voice::kScip2;
    voice = Voice::kScip2;
  }
  return voice;
}

std::vector<int> candidates(int wanted) {
  std::vector<int> bauds{wanted};
  for (const int baud : {kPowerUpBaud, kUsualBaud}) {
    if (baud != wanted) bauds.push_back(baud);
  }
  return bauds;
}

struct Found {
  Voice voice;
  int baud;
};

Found find(Link& link, const HandshakeSettings& settings) {
  if (!link.hasBaud()) {
    const Voice voice = quiet(link, settings.answer_timeout);
    if (voice != Voice::kNone) return {voice, 0};
    throw LinkLost("LASER_NO_ANSWER: connected, but no sensor answers QT");
  }
  std::string tried;
  for (const int baud : candidates(settings.baud)) {
    link.setBaud(baud);
    const Voice voice = quiet(link, kProbeTimeout);
    if (voice != Voice::kNone) return {voice, baud};
    tried += (tried.empty() ? "" : ", ") + std::to_string(baud);
  }
  throw LinkLost("LASER_NO_ANSWER: no sensor answers QT at " + tried + " baud");
}

void speakScip2(Link& link, double timeout) {
  link.ask("SCIP2.0", timeout);
  if (quiet(link, timeout) == Voice::kScip2) return;
  throw Refused("LASER_SCIP1: the sensor stays in SCIP 1.1; older firmware has no SCIP 2.0");
}

bool confirms(Link& link) {
  for (int i = 0; i < kTries; ++i) {
    if (quiet(link, kProbeTimeout) == Voice::kScip2) return true;
  }
  return false;
}

/// Goes to another rate, if the sensor does. It changes only after it has answered.
int changeBaud(Link& link, int from, const HandshakeSettings& settings, const Tell& tell) {
  char command[16];
  std::snprintf(command, sizeof(command), "SS%06d", settings.baud);
  const std::string status = link.ask(command, settings.answer_timeout).status;
  if (status != "00" && status != "03") {
    tell(Report::Level::kWarning, "LASER_BAUD: the sensor refuses " + std::to_string(settings.baud) +
                                      " baud by status " + status + "; it stays at " + std::to_string(from));
    return from;
  }
  link.setBaud(settings.baud);
  if (confirms(link)) return settings.baud;
  throw LinkLost("LASER_NO_ANSWER: the sensor agreed to " + std::to_string(settings.baud) +
                 " baud, but does not answer there");
}

scip::Message askAgain(Link& link, const std::string& command, double timeout) try {
  return link.ask(command, timeout);
} catch (const NoAnswer& problem) {
  throw WentSilent(std::string(problem.what()) + " after one with a wrong sum: it is asked once from now on");
}

/// VV, PP or II. A wrong sum may be the line's or the firmware's: real ones send VV with one. What comes twice alike
/// is what was meant.
scip::Message describe(Link& link, const std::string& command, const HandshakeSettings& settings,
                       const Tell& tell) {
  const auto told = [&](const scip::Message& reply, const char* when) {
    tell(Report::Level::kWarning, "LASER_BAD_SUM: " + command + when + std::to_string(reply.bad_sums) +
                                      " wrong sums: accepted as it is");
    return reply;
  };
  scip::Message reply = link.ask(command, settings.answer_timeout);
  if (reply.bad_sums == 0) return reply;
  if (settings.ask_once) return told(reply, ", which is asked once, comes with ");
  for (int i = 1; i < kTries && reply.bad_sums > 0; ++i) {
    scip::Message again = askAgain(link, command, settings.answer_timeout);
    const bool alike = again.lines == reply.lines;
    reply = std::move(again);
    if (alike && reply.bad_sums > 0) return told(reply, " always comes with ");
  }
  if (reply.bad_sums == 0) return reply;
  throw LinkLost("LASER_BAD_SUM: " + command + " has a wrong sum each time, and never the same content");
}

std::optional<Told> timeIn(const std::map<std::string, std::string>& state, double host) {
  constexpr std::size_t kDigits = 6;
  const auto found = state.find("TIME");
  if (found == state.end() || found->second.size() != kDigits) return std::nullopt;
  const std::string& digits = found->second;
  std::uint32_t clock = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + kDigits, clock, 16);
  if (error != std::errc() || end != digits.data() + kDigits) return std::nullopt;
  return Told{clock, host};
}

scip::Parameters askParameters(Link& link, const HandshakeSettings& settings, const Tell& tell) {
  const scip::Message reply = describe(link, "PP", settings, tell);
  if (reply.status != "00") throw Refused("LASER_REFUSED: PP is answered by status " + reply.status);
  try {
    return scip::parameters(reply);
  } catch (const scip::BadFrame& problem) {
    throw Refused(std::string("LASER_BAD_PP: the sensor sends impossible values: ") + problem.what());
  }
}

}  // namespace

Sensor handshake(Link& link, const HandshakeSettings& settings, const Tell& tell) {
  const Found found = find(link, settings);
  Sensor sensor;
  sensor.baud = found.baud;
  if (found.voice == Voice::kScip1) speakScip2(link, settings.answer_timeout);
  if (found.baud != 0 && found.baud != settings.baud)
    sensor.baud = changeBaud(link, found.baud, settings, tell);
  link.ask("TM2", settings.answer_timeout,
           settings.answer_timeout);  // out of the adjust mode, in which another program may have died
  sensor.version = describe(link, "VV", settings, tell);
  sensor.parameters = askParameters(link, settings, tell);
  const scip::Message state = describe(link, "II", settings, tell);
  sensor.state = scip::keyed(state);
  sensor.time = timeIn(sensor.state, state.first_byte);
  return sensor;
}

}  // namespace kurumaisu::laser
