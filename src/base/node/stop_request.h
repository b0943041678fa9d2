// SPDX-License-Identifier: BSD-3-Clause
// The wish that this node ends, by any signal that can be handled or `rosnode kill`: neutral comes before the end.
#pragma once

namespace kurumaisu {

/// Takes the place of what roscpp does at `rosnode kill` and SIGINT: it would close the topics first. A real crash first
/// hangs up on the guard.
void catchStopRequests();

bool isStopRequested();

}  // namespace kurumaisu
