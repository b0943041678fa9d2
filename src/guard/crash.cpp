// SPDX-License-Identifier: BSD-3-Clause
#include "guard/crash.h"

#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <csignal>

#include "signals.h"

namespace kurumaisu::guard {
namespace {

std::atomic<int> to_hang_up{-1};
void (*on_sent)(int) = nullptr;

/// Nothing but system calls that a signal's handler may make. A core file is not written at a real-time priority: that
/// would keep the kernel's thread that carries the tty's bytes waiting, and neutral.
void onCrash(int signal, siginfo_t* info, void* /*context*/) {
  if (on_sent != nullptr && info->si_code == SI_USER && info->si_pid != getpid()) return on_sent(signal);
  std::signal(signal, SIG_DFL);
  hangUp();
  const sched_param ordinary{};
  sched_setscheduler(0, SCHED_OTHER, &ordinary);
  raise(signal);
}

}  // namespace

void hangUp() { shutdown(to_hang_up, SHUT_RDWR); }

void catchCrashes(void (*sent)(int signal)) {
  on_sent = sent;
  struct sigaction action {};
  action.sa_sigaction = onCrash;
  action.sa_flags = SA_SIGINFO | SA_NODEFER;
  for (const int signal : kCrashes) sigaction(signal, &action, nullptr);
}

void hangUpOnCrash(int socket) { to_hang_up = socket; }

}  // namespace kurumaisu::guard
