// SPDX-License-Identifier: BSD-3-Clause
// Processes that others cannot keep waiting, as far as the system allows.
#pragma once

#include <string>

namespace kurumaisu::guard {

/// Locks the memory and takes a SCHED_FIFO priority, 0 for none. Says what was refused.
void makeRealtime(int priority);

/// How a client comes before others. A process needs processor time even to die: one that busy cores keep from it holds
/// its socket, and so its voltages, meanwhile.
struct Favour {
  int priority;  ///< of SCHED_FIFO, below the guard's; 0: none
  /// [s] of processor time at it without a wait: who takes more loses it, but not his nice value. An endless loop would
  /// keep the kernel's own threads from their work, the tty's among them.
  double longest_run;
  int nice;  ///< also where the priority is refused; 0: as it is. It counts among one session's processes only,
             ///< where the kernel groups them (sched_autogroup_enabled), or systemd does
};

/// Favours all threads of this process, and those that they will start. Returns what was refused, or "".
std::string favourThreads(const Favour& favour);

/// How many threads have lost their priority, having run for too long.
int unfavoured();

}  // namespace kurumaisu::guard
