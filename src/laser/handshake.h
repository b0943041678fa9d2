// SPDX-License-Identifier: BSD-3-Clause
// From an open port to a sensor that speaks SCIP 2.0 and has said what it is.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>

#include "laser/link.h"
#include "laser/status.h"
#include "scip/message.h"
#include "scip/sensor.h"

namespace kurumaisu::laser {

/// The sensor answers, but not with what a driver can use.
struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// It has no intensities.
struct NoIntensity : Refused {
  using Refused::Refused;
};

/// It gave an answer with a wrong sum, and fell silent when asked once more.
struct WentSilent : LinkLost {
  using LinkLost::LinkLost;
};

/// What is told on the way.
using Tell = std::function<void(Report::Level, const std::string&)>;

/// A sensor's clock, as it told it when asked for its state (II).
struct Told {
  std::uint32_t clock;  ///< [ms]
  double host;          ///< [s] host's time at which the answer began to come
};

/// What a sensor says of itself.
struct Sensor {
  scip::Parameters parameters;
  scip::Message version;  ///< VV
  std::map<std::string, std::string> state;
  std::optional<Told> time;  ///< none if II has no TIME of six hexadecimal digits
  int baud = 0;              ///< [baud] at which it was left; 0 where there is none
};

struct HandshakeSettings {
  int baud;               ///< [baud] wanted
  double answer_timeout;  ///< [s]
  bool ask_once;          ///< what comes with a wrong sum is taken as it is: see WentSilent
};

/// Finds a sensor's rate and protocol, quiets it, and asks what it is.
///
/// It may be streaming, be at a rate that another program left, or have just been switched on: SCIP 1.1 at 19200 baud.
/// Throws LinkLost if nothing answers, WentSilent, Refused for parameters that cannot be.
Sensor handshake(Link& link, const HandshakeSettings& settings, const Tell& tell);

}  // namespace kurumaisu::laser
