// SPDX-License-Identifier: BSD-3-Clause
// A process that others cannot keep waiting, as far as the system allows.
#pragma once

namespace kurumaisu::guard {

/// Locks the memory and takes a SCHED_FIFO priority, 0 for none. Says what was refused.
void makeRealtime(int priority);

}  // namespace kurumaisu::guard
