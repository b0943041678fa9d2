// SPDX-License-Identifier: BSD-3-Clause
#include "guard/realtime.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "guard/log.h"

namespace kurumaisu::guard {

void makeRealtime(int priority) {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    say("GUARD_NOT_LOCKED", std::string("memory may be paged out: mlockall: ") + std::strerror(errno));
  }
  if (priority == 0) return;
  sched_param parameters{};
  parameters.sched_priority = priority;
  if (sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) {
    say("GUARD_NOT_REALTIME",
        std::string("busy cores may delay neutral: SCHED_FIFO: ") + std::strerror(errno));
  }
}

std::string favourThreads(int nice) {
  if (nice == 0) return "";
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    const auto thread = static_cast<id_t>(std::stoul(task.path().filename().string()));
    if (setpriority(PRIO_PROCESS, thread, nice) == 0 || errno == ESRCH) continue;
    return "nice " + std::to_string(nice) + ": " + std::strerror(errno);
  }
  return "";
}

}  // namespace kurumaisu::guard
