// SPDX-License-Identifier: BSD-3-Clause
// guard_client SOCKET MODE PRIORITY LONGEST_RUN NICE: drives through the guard as base_node does, and breaks in one of many
// ways when its standard input says so; for scripts/bench guard. It prints "armed" when its voltage is out, and the time of
// the break.
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "guard/client.h"
#include "guard/crash.h"
#include "guard/realtime.h"
#include "steady.h"

namespace g = kurumaisu::guard;

namespace {

constexpr double kRate = 50;           // [Hz] base_node's
constexpr double kReplyWait = 0.01;    // [s]
constexpr double kRetryPause = 0.005;  // [s]
constexpr double kVolts = 0.4;         // [V] on both axes
constexpr double kReference = 2.5;     // [V]
constexpr std::size_t kResident =
    12 << 20;  // [bytes] with them it is as large as base_node: to give them back takes time

void leave() { std::exit(0); }
void dump() {
  const rlimit all{RLIM_INFINITY, RLIM_INFINITY};
  setrlimit(RLIMIT_CORE, &all);
  volatile int* nowhere = nullptr;
  *nowhere = 1;
}
void crash() {
  volatile int* nowhere = nullptr;
  *nowhere = 1;
}
void lock() {
  std::mutex mutex;
  mutex.lock();
  mutex.lock();
}
void loop() {
  for (volatile int i = 0;; i = i + 1) {
  }
}
void wait() {
  for (;;) pause();
}

const std::map<std::string, void (*)()> kBreaks = {{"exit", leave},    {"crash", crash}, {"dump", dump},
                                                   {"deadlock", lock}, {"loop", loop},   {"wait", wait}};

/// Waits for the next turn; true if told to break.
bool isTold(double until) {
  pollfd in{STDIN_FILENO, POLLIN, 0};
  const double left = until - kurumaisu::steadyTime();
  return poll(&in, 1, left > 0 ? static_cast<int>(1e3 * left) : 0) > 0;
}

void say(const std::string& line) {
  [[maybe_unused]] const ssize_t written = write(STDOUT_FILENO, (line + "\n").data(), line.size() + 1);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) return 2;
  const std::string mode = argv[2];
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const std::vector<char> ballast(kResident, 1);
  g::catchCrashes();
  g::Client client({argv[1], kReplyWait, kRetryPause});
  g::favourThreads({std::stoi(argv[3]), std::stod(argv[4]), std::stoi(argv[5])});
  bool was_out = false;
  for (double next = kurumaisu::steadyTime();; next += 1 / kRate) {
    if (isTold(next)) break;
    const bool is_armed = client.status().connected && client.status().state == g::State::kArmed;
    const double volts =
        is_armed ? kVolts : 0;  // as somebody would who holds the stick, and lets it go when it trips
    const g::Status& status = client.put({volts, volts, kReference});
    const bool is_out = volts != 0 && status.connected && status.volts.translation > kVolts / 2;
    if (is_out && !was_out) say("armed");
    was_out = is_out;
  }
  say(std::to_string(kurumaisu::steadyNanoseconds()));
  if (mode == "nonsense") client.put({std::numeric_limits<double>::quiet_NaN(), 0, kReference});
  if (mode == "nonsense") wait();
  const auto found = kBreaks.find(mode);
  if (found == kBreaks.end()) return 2;
  found->second();
  return 0;
}
