// SPDX-License-Identifier: BSD-3-Clause
// Signals, for programs that must do something before they end.
#pragma once

#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <optional>
#include <string>

#include "file_descriptor.h"

namespace kurumaisu {

/// What the kernel sends to a process for a fault of its own.
constexpr std::array kCrashes = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGSYS, SIGTRAP};

inline bool isCrash(int signal) {
  return std::find(kCrashes.begin(), kCrashes.end(), signal) != kCrashes.end();
}

/// Whether a signal would end or stop a process that does nothing about it; all such signals mean: end.
inline bool isToEnd(int signal) {
  constexpr std::array kHarmless = {SIGCHLD, SIGCONT, SIGURG, SIGWINCH, SIGPIPE};  // the last: a write tells
  return std::find(kHarmless.begin(), kHarmless.end(), signal) == kHarmless.end();
}

/// Every signal that can be held back waits to be read in place of ending, or stopping, this process; signalfd(2).
/// SIGKILL, SIGSTOP and a crash of its own cannot.
class Signals {
 public:
  Signals() {
    sigset_t set;
    sigfillset(&set);
    sigprocmask(SIG_BLOCK, &set, nullptr);
    descriptor_ = Descriptor(checked(signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC), "signalfd"));
  }

  int fd() const { return descriptor_.get(); }

  /// The next that came and says to end, isToEnd(); none if there is none. The others are passed over.
  std::optional<int> nextToEnd() const {
    signalfd_siginfo info{};
    while (read(descriptor_.get(), &info, sizeof info) == sizeof info) {
      const int signal = static_cast<int>(info.ssi_signo);
      if (isToEnd(signal)) return signal;
    }
    return std::nullopt;
  }

 private:
  Descriptor descriptor_;
};

/// "SIGHUP"
inline std::string signalName(int signal) {
  const char* const name = sigabbrev_np(signal);
  return name ? std::string("SIG") + name : "signal " + std::to_string(signal);
}

}  // namespace kurumaisu
