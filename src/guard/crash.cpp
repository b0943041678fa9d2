// SPDX-License-Identifier: BSD-3-Clause
#include "guard/crash.h"

#include <sched.h>
#include <sys/socket.h>

#include <atomic>
#include <csignal>
#include <initializer_list>

namespace kurumaisu::guard {
namespace {

std::atomic<int> to_hang_up{-1};

/// Nothing but system calls that a signal's handler may make. A core file is not written at a real-time priority: that
/// would keep the kernel's thread that carries the tty's bytes waiting, and neutral.
void hangUp(int signal) {
  shutdown(to_hang_up, SHUT_RDWR);
  const sched_param ordinary{};
  sched_setscheduler(0, SCHED_OTHER, &ordinary);
  raise(signal);  // by then its default again
}

}  // namespace

void catchCrashes() {
  struct sigaction action {};
  action.sa_handler = hangUp;
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_NODEFER;
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) sigaction(signal, &action, nullptr);
}

void hangUpOnCrash(int socket) { to_hang_up = socket; }

}  // namespace kurumaisu::guard
