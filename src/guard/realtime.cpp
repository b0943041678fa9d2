// SPDX-License-Identifier: BSD-3-Clause
#include "guard/realtime.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <functional>

#include "guard/log.h"

namespace kurumaisu::guard {
namespace {

rlimit longest_run{};          // [us]
std::atomic<int> too_long{0};  // threads

int setPriority(pid_t thread, int policy, int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  return sched_setscheduler(thread, policy, &parameters);
}

/// In the thread that has run for too long; what it does may be done in a signal's handler.
void loseFavour(int /*signal*/) {
  const int error = errno;
  setPriority(0, SCHED_OTHER, 0);
  setrlimit(RLIMIT_RTTIME, &longest_run);  // the kernel has moved it on by a second
  ++too_long;
  errno = error;
}

/// What was refused of something done to each thread, or "".
std::string forEachThread(const std::string& what, const std::function<int(pid_t)>& action) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    const pid_t thread = std::stoi(task.path().filename().string());
    if (action(thread) == 0 || errno == ESRCH) continue;
    return what + ": " + std::strerror(errno);
  }
  return "";
}

void boundRun(double seconds) {
  getrlimit(RLIMIT_RTTIME, &longest_run);
  longest_run.rlim_cur = std::min(static_cast<rlim_t>(1e6 * seconds), longest_run.rlim_max);
  struct sigaction action {};
  action.sa_handler = loseFavour;
  action.sa_flags = SA_RESTART;
  sigaction(SIGXCPU, &action, nullptr);
  setrlimit(RLIMIT_RTTIME, &longest_run);
}

}  // namespace

void makeRealtime(int priority) {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    say("GUARD_NOT_LOCKED", std::string("memory may be paged out: mlockall: ") + std::strerror(errno));
  }
  if (priority == 0) return;
  if (setPriority(0, SCHED_FIFO, priority) != 0) {
    say("GUARD_NOT_REALTIME",
        std::string("busy cores may delay neutral: SCHED_FIFO: ") + std::strerror(errno));
  }
}

std::string favourThreads(const Favour& favour) {
  std::string refusal;
  if (favour.nice != 0) {
    refusal = forEachThread("nice " + std::to_string(favour.nice), [&favour](pid_t thread) {
      return setpriority(PRIO_PROCESS, static_cast<id_t>(thread), favour.nice);
    });
  }
  if (favour.priority == 0) return refusal;
  boundRun(favour.longest_run);
  const std::string other =
      forEachThread("SCHED_FIFO " + std::to_string(favour.priority),
                    [&favour](pid_t thread) { return setPriority(thread, SCHED_FIFO, favour.priority); });
  return other + (other.empty() || refusal.empty() ? "" : "; ") + refusal;
}

int unfavoured() { return too_long; }

}  // namespace kurumaisu::guard
