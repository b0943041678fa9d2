// SPDX-License-Identifier: BSD-3-Clause
// The client's side of the guard: a crash that is heard, a priority that is lost, nobody there.
#include <gtest/gtest.h>
#include <poll.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include <array>
#include <csignal>
#include <string>

#include "guard/crash.h"
#include "guard/realtime.h"
#include "guard/socket.h"
#include "guard_process.h"

namespace test_guard_link {

using namespace guarding;  // NOLINT: a test

namespace {

/// What a child does with a client's connection, which a grandchild holds open until nobody has the gate's other end.
void crash(const std::string& path, const std::array<int, 2>& gate) {
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  g::catchCrashes();
  g::Client client({path, kReplyWait, 0.01});
  client.put({0, 0, 2.5});
  if (fork() == 0) {
    close(gate[1]);
    char byte = 0;
    _exit(static_cast<int>(read(gate[0], &byte, 1)));
  }
  raise(SIGSEGV);
}

/// The policy of this thread once it has run for so long at a real-time priority; -1: it may have none.
int policyAfter(double seconds) {
  if (!g::favourThreads({1, 0.02, 0}).empty()) return -1;
  timespec used{};
  do clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  while (static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec) < seconds &&
         sched_getscheduler(0) == SCHED_FIFO);
  return sched_getscheduler(0);
}

}  // namespace

TEST(GuardClient, ACrashIsHeardThoughTheSocketIsStillOpen) {
  std::string name = (fs::temp_directory_path() / "guard_XXXXXX").string();
  const fs::path folder = mkdtemp(name.data());
  const kurumaisu::Descriptor listener = g::listenAt(folder / "socket");
  std::array<int, 2> gate{};
  ASSERT_EQ(pipe(gate.data()), 0);
  const pid_t child = fork();
  if (child == 0) crash(folder / "socket", gate);
  kurumaisu::Descriptor peer;
  for (const double until = kurumaisu::steadyTime() + kPatience; !peer && kurumaisu::steadyTime() < until;) {
    pause(0.001);
    peer = kurumaisu::Descriptor(accept(listener.get(), nullptr, nullptr));
  }
  pollfd ready{peer.get(), POLLRDHUP, 0};
  EXPECT_EQ(poll(&ready, 1, static_cast<int>(1e3 * kPatience)), 1);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGSEGV);
  for (const int end : gate) close(end);
  fs::remove_all(folder);
}
TEST(GuardClient, WhoRunsTooLongLosesHisPriority) {
  const pid_t child = fork();
  if (child == 0) _exit(policyAfter(1) == SCHED_OTHER && g::unfavoured() == 1 ? 0 : geteuid() == 0 ? 1 : 77);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == 77) GTEST_SKIP() << "may have no priority";
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST(GuardClient, WithoutAGuardItDoesNotWait) {
  g::Client client({"/nowhere/at/all", 1.0, 0.01});
  const double begin = kurumaisu::steadyTime();
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(client.put({0.4, 0, 2.5}).connected);
  EXPECT_LT(kurumaisu::steadyTime() - begin, kSoon);
  EXPECT_EQ(client.status().volts.translation, 0);
}

}  // namespace test_guard_link
