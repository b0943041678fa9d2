// SPDX-License-Identifier: BSD-3-Clause
// A process that others cannot keep waiting, as far as the system allows.
#pragma once

#include <string>

namespace kurumaisu::guard {

/// Locks the memory and takes a SCHED_FIFO priority, 0 for none. Says what was refused.
void makeRealtime(int priority);

/// Gives all threads of this process a nice value, and with them those that they will start. A process needs processor
/// time even to die: one that busy cores keep from it holds its socket, and so its voltages, meanwhile. Not a real-time
/// priority: an endless loop at one keeps the kernel's own threads from their work, the tty's among them, and so neutral.
/// Returns what was refused, or "".
std::string favourThreads(int nice);

}  // namespace kurumaisu::guard
