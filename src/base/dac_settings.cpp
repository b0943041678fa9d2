// SPDX-License-Identifier: BSD-3-Clause
#include "base/dac_settings.h"

namespace kurumaisu {
namespace {

constexpr int kHighestPriority = 99;  // sched(7)

}  // namespace

DacSettings readDac(Section dac, Section guard) {
  const bool has_guard = dac.choice("kind", {"topic", "guard"}) == "guard";
  const guard::ClientSettings client{guard.text("socket"), dac.above("reply_wait", 0),
                                     dac.above("retry_pause", 0)};
  const int priority = dac.integer("priority", 0, kHighestPriority);
  dac.end();
  return {has_guard ? std::optional(client) : std::nullopt, priority};
}

}  // namespace kurumaisu
