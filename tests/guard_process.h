// SPDX-License-Identifier: BSD-3-Clause
// Guard and sentinel as processes that are really killed, in front of a board in shared memory.
#pragma once

#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "guard/client.h"
#include "guard/sentinel.h"
#include "guarding.h"
#include "shared_board.h"

namespace guarding {

namespace fs = std::filesystem;

constexpr double kPatience = 10;  // [s] for what must happen
constexpr double kSoon =
    1;  // [s] for what must not wait, on a busy machine; how soon, scripts/bench guard tells
constexpr double kPeriod = 0.01;     // [s] of the client
constexpr double kReplyWait = 0.05;  // [s]

void pause(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

inline bool isNeutral(const d::Volts& volts) {
  return volts.translation == 0 && volts.steering == 0 && volts.reference == 2.5;
}

class GuardProcess : public testing::Test {
 protected:
  GuardProcess() {
    std::string name = (fs::temp_directory_path() / "guard_XXXXXX").string();
    folder = mkdtemp(name.data());
    settings.limits = limits();
    settings.socket = folder / "socket";
    settings.period = 0.01;
    settings.priority = 0;
    settings.reopening = {0.01, 0.05};
    settings.sentinel_silence = 0.3;
    settings.restart_pause = 0.02;
    settings.neutral_patience = 0.5;
  }

  ~GuardProcess() override {
    if (sentinel > 0) end(SIGTERM);
    fs::remove_all(folder);
  }

  void start() {
    const std::size_t before = board->count;
    sentinel = fork();
    if (sentinel == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);  // of a test that is killed nothing remains
      _exit(g::runSentinel(settings, board.opener()));
    }
    waitFor([this] { return fs::exists(settings.socket); }, "the socket");
    waitFor([&] { return board->count > before || board->unplugged || board->broken; }, "its first word");
  }

  /// Ends the sentinel; returns its wait status.
  int end(int signal) {
    int status = 0;
    kill(sentinel, signal);
    waitpid(sentinel, &status, 0);
    sentinel = -1;
    return status;
  }

  static void waitFor(const std::function<bool()>& condition, const char* what) {
    for (const double until = kurumaisu::steadyTime() + kPatience; !condition(); pause(0.001)) {
      if (kurumaisu::steadyTime() > until) FAIL() << "waited in vain for " << what;
    }
  }

  /// Puts until the status is as wished.
  void putUntil(g::Client& client, double translation, const std::function<bool(const g::Status&)>& wish) {
    waitFor(
        [&] {
          pause(kPeriod);
          return wish(client.put({translation, 0, 2.5}));
        },
        "a status");
  }

  void arm(g::Client& client) {
    putUntil(client, 0, [](const g::Status& s) { return s.state == g::State::kArmed; });
  }

  void drive(g::Client& client) {
    arm(client);
    putUntil(client, 0.4, [](const g::Status& s) { return s.volts.translation == 0.4; });
    ASSERT_EQ(board->last().volts.translation, 0.4);
  }

  /// How long after `begin` [s] the board was neutral, for good.
  double neutralAfter(double begin) {
    waitFor([this] { return isNeutral(board->last().volts); }, "neutral");
    std::size_t i = board->count - 1;
    while (isNeutral(board->written[i - 1].volts)) --i;
    return board->written[i].time - begin;
  }

  pid_t guardPid() { return board->last().by; }

  g::Client client() const { return g::Client({settings.socket, kReplyWait, 0.01}); }

  fs::path folder;
  g::Settings settings{};
  SharedBoard board;
  pid_t sentinel = -1;
};

}  // namespace guarding
