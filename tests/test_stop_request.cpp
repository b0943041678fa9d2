// SPDX-License-Identifier: BSD-3-Clause
// Every signal by its number: base_node is asked to end by it, and has the time for neutral.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "base/node/stop_request.h"
#include "file_descriptor.h"
#include "signals.h"

namespace test_stop_request {

constexpr int kPatience = 10'000;  // [ms]

/// A process that says when it catches signals, and ends in order, with status 7, once it is asked to.
class Asked {
 public:
  Asked() {
    int ends[2];
    EXPECT_EQ(pipe(ends), 0);
    kurumaisu::Descriptor ready(ends[0]);
    pid_ = fork();
    if (pid_ == 0) {
      kurumaisu::catchStopRequests();
      [[maybe_unused]] const ssize_t said = write(ends[1], "", 1);
      for (int i = 0; i < kPatience && !kurumaisu::isStopRequested(); ++i) poll(nullptr, 0, 1);
      _exit(7);
    }
    close(ends[1]);
    char byte = 0;
    EXPECT_EQ(read(ready.get(), &byte, 1), 1);
  }

  int endBy(int signal) const {
    kill(pid_, signal);
    int status = 0;
    waitpid(pid_, &status, 0);
    return status;
  }

 private:
  pid_t pid_;
};

TEST(StopRequest, EverySignalThatCanBeHandledIsOne) {
  int tried = 0;
  for (int signal = 1; signal <= SIGRTMAX; ++signal) {
    const bool cannot = signal == SIGKILL || signal == SIGSTOP || (signal >= 32 && signal < SIGRTMIN);
    if (cannot || !kurumaisu::isToEnd(signal)) continue;
    SCOPED_TRACE(signal);
    const int status = Asked().endBy(signal);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 7);
    ++tried;
  }
  EXPECT_EQ(tried, 31 - 2 - 5 + SIGRTMAX - SIGRTMIN + 1);
}

TEST(StopRequest, ACrashOfItsOwnIsNone) {
  const pid_t pid = fork();
  if (pid == 0) {
    kurumaisu::catchStopRequests();
    raise(SIGSEGV);
    _exit(0);
  }
  int status = 0;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
}

}  // namespace test_stop_request
