// SPDX-License-Identifier: BSD-3-Clause
// Keeps strangers from the node's ports. roscpp listens for calls at all addresses, whatever ROS_HOSTNAME says,
// does what anybody asks for, like hearing another publisher, and connects to whoever is named; it has no setting
// for it. So this file puts itself before the C library's bind, accept and connect, for this program only: TCP is
// spoken with this computer, the master's, and those that are allowed; and where ROS calls this computer
// `localhost`, at the loopback only.
#pragma once

#include "base/node/allowed_hosts.h"

namespace kurumaisu {

/// Opens the gate to further computers.
void allowHosts(const AllowedHosts& hosts);

}  // namespace kurumaisu
