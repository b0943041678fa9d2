// SPDX-License-Identifier: BSD-3-Clause
// The wish that this node ends, by a signal or `rosnode kill`: neutral comes before the end.
#pragma once

namespace kurumaisu {

/// Takes the place of what roscpp does at `rosnode kill`, SIGINT and SIGTERM: it would close the topics first.
void catchStopRequests();

bool isStopRequested();

}  // namespace kurumaisu
