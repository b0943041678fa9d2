// SPDX-License-Identifier: BSD-3-Clause
#include "base/dac_settings.h"

namespace kurumaisu {
namespace {

constexpr int kFirst = -20;  // setpriority(2)

}  // namespace

DacSettings readDac(Section dac, Section guard) {
  const bool has_guard = dac.choice("kind", {"topic", "guard"}) == "guard";
  const guard::ClientSettings client{guard.text("socket"), dac.above("reply_wait", 0),
                                     dac.above("retry_pause", 0)};
  const int nice = dac.integer("nice", kFirst, 0);
  const double silence = guard.section("limits").above("silence", 0);
  dac.end();
  return {has_guard ? std::optional(client) : std::nullopt, silence, nice};
}

}  // namespace kurumaisu
