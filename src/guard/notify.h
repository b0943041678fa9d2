// SPDX-License-Identifier: BSD-3-Clause
// Tells systemd how a service is; without systemd nobody listens.
#pragma once

#include <string>

namespace kurumaisu::guard {

/// Sends an assignment such as "READY=1" to where NOTIFY_SOCKET says; sd_notify(3).
void notify(const std::string& assignment);

}  // namespace kurumaisu::guard
