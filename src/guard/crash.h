// SPDX-License-Identifier: BSD-3-Clause
// A crash that the guard hears of at once. The kernel closes a socket only when the process' memory has been written to
// a core file and given back.
#pragma once

namespace kurumaisu::guard {

/// Hangs up the socket that was last named; a signal's handler may call it.
void hangUp();

/// From now on a crash (isCrash(), abort()) first hangs up the socket that was last named. sent: called instead where
/// another process only sent the signal; null: it is a crash, too.
void catchCrashes(void (*sent)(int signal) = nullptr);

/// Names the socket; -1: none. All but the name is for a process that ends: the guard then puts out neutral.
void hangUpOnCrash(int socket);

}  // namespace kurumaisu::guard
