// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/dac_settings.h"

namespace kurumaisu {
namespace {

constexpr int kFirst = -20;           // setpriority(2)
constexpr int kHighestPriority = 99;  // sched(7)

guard::Favour readFavour(Section& dac, int guard_priority) {
  const int priority = dac.integer("priority", 0, kHighestPriority);
  if (priority > 0 && priority >= guard_priority) {
    throw dac.error("priority", "must be below the guard's, " + std::to_string(guard_priority));
  }
  return {priority, dac.above("longest_run", 0), dac.integer("nice", kFirst, 0)};
}

}  // namespace

DacSettings readDac(Section dac, Section guard) {
  const bool has_guard = dac.choice("kind", {"topic", "guard"}) == "guard";
  const guard::ClientSettings client{guard.text("socket"), dac.above("reply_wait", 0),
                                     dac.above("retry_pause", 0)};
  const guard::Favour favour = readFavour(dac, guard.integer("priority", 0, kHighestPriority));
  const double silence = guard.section("limits").above("silence", 0);
  dac.end();
  return {has_guard ? std::optional(client) : std::nullopt, silence, favour};
}

}  // namespace kurumaisu
