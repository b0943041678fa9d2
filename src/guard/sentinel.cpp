// SPDX-License-Identifier: BSD-3-Clause
#include "guard/sentinel.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <exception>
#include <utility>

#include "guard/log.h"
#include "guard/notify.h"
#include "guard/realtime.h"
#include "guard/server.h"
#include "guard/socket.h"
#include "steady.h"

namespace kurumaisu::guard {
namespace {

constexpr double kNotifyPeriod = 0.1;  // [s] of signs of life to systemd; its WatchdogSec is longer

constexpr char kBeat = 0;

/// Empties a socket of signs of life; whether there were any.
bool hearBeats(const Descriptor& socket) {
  char byte = 0;
  std::size_t size = 1;
  bool heard = false;
  for (; receive(socket, &byte, size) == Heard::kMessage; size = 1) heard = true;
  return heard;
}

void sendBeat(const Descriptor& socket) { send(socket, &kBeat, 1); }

/// The guard's end: a sign of its life for each of the sentinel's, which must not be missing for too long.
class Watched {
 public:
  Watched(Descriptor socket, double silence) : socket_(std::move(socket)), silence_(silence) {}

  /// Tells the sentinel that the guard lives; whether the sentinel does.
  bool beat() {
    sendBeat(socket_);
    if (hearBeats(socket_)) heard_ = steadyTime();
    return steadyTime() < heard_ + silence_;
  }

 private:
  Descriptor socket_;
  double silence_;               ///< [s]
  double heard_ = steadyTime();  ///< [s]
};

/// In the child: a guard, whose parent's death is a SIGTERM. It has a session of its own: what a terminal does to its
/// parent's, it does not do to both.
int runGuard(const Settings& settings, const Device::Open& open, Descriptor beats, pid_t parent) {
  try {
    setsid();
    makeRealtime(settings.priority);
    Watched watched(std::move(beats), settings.sentinel_silence);
    Server server(settings, open, [&watched] { return watched.beat(); });
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() == parent) server.run();  // or it died before the line above
    return 0;
  } catch (const std::exception& error) {
    say("GUARD_FAILED", error.what());
    return 1;
  }
}

std::string wordsFor(int status) {
  if (WIFSIGNALED(status)) return std::string("killed: ") + strsignal(WTERMSIG(status));
  return "exit status " + std::to_string(WEXITSTATUS(status));
}

class Sentinel {
 public:
  Sentinel(const Settings& settings, const Device::Open& open) : settings_(settings), open_(open) {}

  int run();

 private:
  void start();
  int watch();
  bool hear();
  void leave();
  bool rest();

  const Settings& settings_;
  const Device::Open& open_;
  Signals signals_;
  Descriptor beats_;
  pid_t guard_ = -1;
  double last_beat_ = 0;  ///< [s]
  double notified_ = 0;   ///< [s]
  bool has_begun_ = false;
  bool is_leaving_ = false;
};

int Sentinel::run() {
  makeRealtime(settings_.priority);
  for (;;) {
    start();
    const int status = watch();
    const double noticed = steadyTime();
    const bool is_clean = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    if (is_leaving_ && is_clean) return 0;
    const bool is_neutral = forceNeutral(settings_, open_, 0);
    say("GUARD_DEAD", wordsFor(status) + (is_neutral ? reaction(noticed, steadyTime()) : ""));
    if (is_leaving_) return 0;
    if (!has_begun_) return 1;
    if (!rest()) return 0;
  }
}

void Sentinel::start() {
  std::array<int, 2> ends{};
  checked(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends.data()), "socketpair");
  beats_ = Descriptor(ends[0]);
  Descriptor beating(ends[1]);
  last_beat_ = steadyTime();
  const pid_t parent = getpid();
  guard_ = checked(fork(), "fork");
  if (guard_ == 0) _exit(runGuard(settings_, open_, std::move(beating), parent));
}

/// Returns the guard's wait status once it is dead.
int Sentinel::watch() {
  for (;;) {
    const double left = std::max(0.0, last_beat_ + settings_.sentinel_silence - steadyTime());
    std::array<pollfd, 2> ready = {{{signals_.fd(), POLLIN, 0}, {beats_.get(), POLLIN, 0}}};
    poll(ready.data(), ready.size(), static_cast<int>(std::ceil(1e3 * left)));
    while (signals_.nextToEnd()) leave();
    int status = 0;
    if (waitpid(guard_, &status, WNOHANG) == guard_) return status;
    if (hear() || steadyTime() < last_beat_ + settings_.sentinel_silence) continue;
    kill(guard_, SIGKILL);
    waitpid(guard_, &status, 0);
    return status;
  }
}

bool Sentinel::hear() {
  if (!hearBeats(beats_)) return false;
  sendBeat(beats_);
  last_beat_ = steadyTime();
  if (!has_begun_) notify("READY=1");
  has_begun_ = true;
  if (last_beat_ >= notified_ + kNotifyPeriod) {
    notified_ = last_beat_;
    notify("WATCHDOG=1");
  }
  return true;
}

void Sentinel::leave() {
  if (!is_leaving_) notify("STOPPING=1");
  is_leaving_ = true;
  kill(guard_, SIGTERM);
}

/// Waits before the next start. False if told to leave.
bool Sentinel::rest() {
  const double until = steadyTime() + settings_.restart_pause;
  while (!is_leaving_ && steadyTime() < until) {
    pollfd ready{signals_.fd(), POLLIN, 0};
    poll(&ready, 1, static_cast<int>(std::ceil(1e3 * std::max(0.0, until - steadyTime()))));
    is_leaving_ = signals_.nextToEnd().has_value();
  }
  return !is_leaving_;
}

}  // namespace

int runSentinel(const Settings& settings, const Device::Open& open) { return Sentinel(settings, open).run(); }

bool forceNeutral(const Settings& settings, const Device::Open& open, double patience) {
  Device device(open, neutralOf(settings.limits), settings.reopening);
  double now = steadyTime();
  for (const double end = now + patience;; now = steadyTime()) {
    if (device.recover(now)) {
      say("GUARD_NEUTRAL", device.name() + ": written from outside the guard");
      return true;
    }
    if (device.retryAt() > end) {
      say("GUARD_NO_NEUTRAL", device.problem());
      return false;
    }
    poll(nullptr, 0, static_cast<int>(std::ceil(1e3 * std::max(0.0, device.retryAt() - now))));
  }
}

}  // namespace kurumaisu::guard
