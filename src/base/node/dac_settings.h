// SPDX-License-Identifier: BSD-3-Clause
// Which D/A converter base_node has: the section dac of its settings.
#pragma once

#include <optional>

#include "guard/client.h"
#include "guard/realtime.h"
#include "params.h"

namespace kurumaisu {

struct DacSettings {
  std::optional<guard::ClientSettings> guard;  ///< none: the topic alone
  double silence;                              ///< after which that guard is neutral [s]
  guard::Favour favour;                        ///< with a guard
};

/// guard: launch/guard.yaml, of which its socket, its priority and its silence concern us. Throws std::invalid_argument
/// naming the parameter.
DacSettings readDac(Section dac, Section guard);

}  // namespace kurumaisu
