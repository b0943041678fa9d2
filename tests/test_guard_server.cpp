// SPDX-License-Identifier: BSD-3-Clause
// What guard and sentinel do when a client, a device or one of them fails.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <array>
#include <csignal>
#include <fstream>
#include <string>
#include <vector>

#include "guard/socket.h"
#include "guard_process.h"
#include "signals.h"

namespace test_guard_server {

using namespace guarding;  // NOLINT: a test

/// [s] of the processor that a process has used.
double cpuOf(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string word;
  for (int i = 0; i < 13; ++i) file >> word;
  double user = 0;
  double system = 0;
  file >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

TEST_F(GuardProcess, WritesNeutralAndReferenceFirstAndAllTheTimeWithoutAClient) {
  start();
  EXPECT_TRUE(isNeutral(board->written[0].volts));
  const std::size_t before = board->count;
  waitFor([&] { return board->count > before + 20; }, "the output to be written again");
  for (std::size_t i = 0; i < board->count; ++i) EXPECT_TRUE(isNeutral(board->written[i].volts));
}

TEST_F(GuardProcess, ArmsAndTellsWhatIsPutOut) {
  start();
  g::Client driver = client();
  drive(driver);
  EXPECT_TRUE(driver.status().has_device);
  EXPECT_EQ(driver.status().volts.reference, 2.5);
  EXPECT_EQ(driver.status().connections, 1U);
}

TEST_F(GuardProcess, AStartWithACommandStaysNeutral) {
  start();
  g::Client driver = client();
  for (const double until = kurumaisu::steadyTime() + 0.8; kurumaisu::steadyTime() < until; pause(kPeriod))
    driver.put({0.4, 0, 2.5});
  EXPECT_EQ(driver.status().reason, g::Reason::kNotNeutral);
  for (std::size_t i = 0; i < board->count; ++i) EXPECT_TRUE(isNeutral(board->written[i].volts));
}

TEST_F(GuardProcess, AClientThatGoesIsFollowedByNeutral) {
  start();
  {
    g::Client driver = client();
    drive(driver);
  }
  EXPECT_LT(neutralAfter(kurumaisu::steadyTime()), kSoon);
  EXPECT_TRUE(isNeutral(board->last().volts));
}

TEST_F(GuardProcess, AClientThatFallsSilentIsFollowedByNeutral) {
  start();
  g::Client driver = client();
  drive(driver);
  const double begin = kurumaisu::steadyTime();
  const double after = neutralAfter(begin);
  EXPECT_GT(after, 0.05);
  EXPECT_LT(after, 0.15 + kSoon);
  putUntil(driver, 0.4, [](const g::Status& s) { return s.reason == g::Reason::kSilent; });
  drive(driver);  // after neutral was held again
}

TEST_F(GuardProcess, StopIsNeutralAtOnce) {
  start();
  g::Client driver = client();
  drive(driver);
  const double begin = kurumaisu::steadyTime();
  EXPECT_EQ(driver.stop().reason, g::Reason::kStopped);
  EXPECT_LT(neutralAfter(begin), kSoon);
}

TEST_F(GuardProcess, ASecondClientIsToldThatItIsOne) {
  start();
  g::Client driver = client();
  drive(driver);
  g::Client second = client();
  waitFor(
      [&] {
        driver.put({0.4, 0, 2.5});
        return second.put({0, 0, 2.5}).reason == g::Reason::kBusy;
      },
      "the refusal");
  waitFor([&] { return !second.put({0, 0, 2.5}).connected; }, "the end of the connection");
  EXPECT_EQ(driver.put({0.4, 0, 2.5}).state, g::State::kArmed);
}

TEST_F(GuardProcess, BytesThatAreNoMessageTrip) {
  start();
  for (const std::size_t size : {1U, 47U, 48U, 49U, 4000U}) {
    kurumaisu::Descriptor raw;
    waitFor([&] { return static_cast<bool>(raw = g::connectTo(settings.socket)); }, "a connection");
    std::uint64_t sequence = 0;
    waitFor(
        [&] {
          pause(kPeriod);
          const g::Request neutral = request(++sequence, kurumaisu::steadyTime());
          g::send(raw, &neutral, sizeof neutral);
          g::Reply reply{};
          std::size_t length = sizeof reply;
          while (g::receive(raw, &reply, length) == g::Heard::kMessage) length = sizeof reply;
          return g::stateOf(reply.state) == g::State::kArmed;
        },
        "arming");
    const std::string garbage(size, 'x');
    EXPECT_EQ(g::send(raw, garbage.data(), garbage.size()), g::Sent::kYes);
    g::Reply reply{};
    waitFor(
        [&] {
          std::size_t length = sizeof reply;
          return g::receive(raw, &reply, length) == g::Heard::kMessage &&
                 g::reasonOf(reply.reason) == g::Reason::kGarbage;
        },
        "the reason");
    EXPECT_EQ(g::stateOf(reply.state), g::State::kTripped);
  }
}

TEST_F(GuardProcess, ADeviceThatFailsAndComesBackIsNeutralUntilArmedAnew) {
  start();
  g::Client driver = client();
  for (std::atomic<bool> Board::*fault : {&Board::broken, &Board::unplugged}) {
    drive(driver);
    (*board.operator->()).*fault = true;
    putUntil(driver, 0.4, [](const g::Status& s) { return !s.has_device && s.reason == g::Reason::kDevice; });
    const std::size_t before = board->count;
    (*board.operator->()).*fault = false;
    putUntil(driver, 0.4, [](const g::Status& s) { return s.has_device; });
    EXPECT_TRUE(isNeutral(board->written[before].volts));
    EXPECT_EQ(driver.status().state, g::State::kTripped);
    EXPECT_TRUE(isNeutral(board->last().volts));
  }
}

TEST_F(GuardProcess, ADeviceThatHoldsAnotherReferenceOrNoNeutralDoesNotCount) {
  start();
  g::Client driver = client();
  for (std::atomic<double> Board::*fault : {&Board::offset, &Board::residue}) {
    drive(driver);
    (*board.operator->()).*fault = 0.02;  // more than either tolerance
    putUntil(driver, 0, [](const g::Status& s) { return !s.has_device && s.reason == g::Reason::kDevice; });
    const double until = kurumaisu::steadyTime() + 0.8;
    putUntil(driver, 0, [until](const g::Status& s) {
      return s.state == g::State::kArmed || kurumaisu::steadyTime() > until;
    });
    EXPECT_EQ(driver.status().state, g::State::kTripped);
    (*board.operator->()).*fault = 0.0;
  }
  drive(driver);
}

TEST_F(GuardProcess, AMissingDeviceIsWaitedFor) {
  board->unplugged = true;
  start();
  g::Client driver = client();
  putUntil(driver, 0, [](const g::Status& s) { return s.connected && s.reason == g::Reason::kDevice; });
  board->unplugged = false;
  drive(driver);
}

TEST_F(GuardProcess, TheSentinelWritesNeutralForAKilledGuardAndStartsAnother) {
  start();
  g::Client driver = client();
  for (const int signal : {SIGKILL, SIGSEGV}) {
    drive(driver);
    const pid_t killed = guardPid();
    ASSERT_NE(killed, sentinel);
    const double begin = kurumaisu::steadyTime();
    kill(killed, signal);
    EXPECT_LT(neutralAfter(begin), kSoon);
    waitFor([&] { return guardPid() != killed && guardPid() != sentinel; }, "another guard");
    bool by_sentinel = false;
    for (std::size_t i = 0; i < board->count; ++i) by_sentinel |= board->written[i].by == sentinel;
    EXPECT_TRUE(by_sentinel);
    putUntil(driver, 0.4, [](const g::Status& s) { return s.connected && s.state == g::State::kTripped; });
    EXPECT_TRUE(isNeutral(board->last().volts));
  }
}

TEST_F(GuardProcess, TheSentinelEndsAGuardThatHangs) {
  start();
  g::Client driver = client();
  drive(driver);
  const pid_t stopped = guardPid();
  const double begin = kurumaisu::steadyTime();
  kill(stopped, SIGSTOP);
  // the client is never held up longer than it allows
  const double before = kurumaisu::steadyTime();
  const g::Status& status = driver.put({0.4, 0, 2.5});
  EXPECT_LT(kurumaisu::steadyTime() - before, kReplyWait + kSoon);
  EXPECT_GE(status.late, 1U);
  EXPECT_LT(neutralAfter(begin), 0.3 + kSoon);
  waitFor([&] { return guardPid() != stopped && guardPid() != sentinel; }, "another guard");
}

TEST_F(GuardProcess, AGuardWhoseSentinelDiesEndsNeutral) {
  start();
  g::Client driver = client();
  drive(driver);
  const pid_t guard = guardPid();
  const double begin = kurumaisu::steadyTime();
  end(SIGKILL);
  EXPECT_LT(neutralAfter(begin), kSoon);
  EXPECT_EQ(guardPid(), guard);
  waitFor([&] { return !driver.put({0.4, 0, 2.5}).connected; }, "the client to notice");
  EXPECT_TRUE(isNeutral(driver.status().volts) || driver.status().volts.reference == 2.5);
}

constexpr double kSoonArmed = 0.16;  // [s] for the sake of many rounds

/// Numbers of all signals that end or stop whoever does nothing about them; 32 and 33 are glibc's.
std::vector<int> signalsThatEnd() {
  std::vector<int> numbers;
  for (int signal = 1; signal <= SIGRTMAX; ++signal) {
    if (kurumaisu::isToEnd(signal) && (signal < 32 || signal >= SIGRTMIN)) numbers.push_back(signal);
  }
  return numbers;
}

TEST_F(GuardProcess, EverySignalToTheSentinelIsFollowedByNeutralAndItsEnd) {
  settings.limits.arming = kSoonArmed;
  ASSERT_EQ(signalsThatEnd().size(), 31U - 5U + 31U);
  for (const int signal : signalsThatEnd()) {
    if (signal == SIGKILL || signal == SIGSTOP) continue;  // below
    SCOPED_TRACE(signal);
    start();
    g::Client driver = client();
    drive(driver);
    const double begin = kurumaisu::steadyTime();
    const int status = end(signal);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 0);
    EXPECT_LT(neutralAfter(begin), kSoon);
    EXPECT_TRUE(isNeutral(board->last().volts));
  }
}

TEST_F(GuardProcess, EverySignalToTheGuardIsFollowedByNeutralAndAnotherGuard) {
  settings.limits.arming = kSoonArmed;
  start();
  g::Client driver = client();
  for (const int signal : signalsThatEnd()) {
    SCOPED_TRACE(signal);
    drive(driver);
    const pid_t guard = guardPid();
    const double begin = kurumaisu::steadyTime();
    kill(guard, signal);
    EXPECT_LT(neutralAfter(begin), 0.3 + kSoon);  // SIGSTOP: the sentinel's patience
    waitFor([&] { return guardPid() != guard && guardPid() != sentinel; }, "another guard");
  }
}

TEST_F(GuardProcess, AStoppedSentinelMeansNeutralUntilItGoesOn) {
  start();
  g::Client driver = client();
  drive(driver);
  const pid_t guard = guardPid();
  const double begin = kurumaisu::steadyTime();
  kill(sentinel, SIGSTOP);
  EXPECT_LT(neutralAfter(begin), 0.3 + kSoon);
  putUntil(driver, 0, [](const g::Status& s) { return s.reason == g::Reason::kUnwatched; });
  kill(sentinel, SIGCONT);
  drive(driver);
  EXPECT_EQ(guardPid(), guard);
}

TEST_F(GuardProcess, ATerminalThatSignalsTheSentinelDoesNotSignalTheGuard) {
  start();
  EXPECT_NE(getsid(guardPid()), getsid(sentinel));
  EXPECT_NE(getpgid(guardPid()), getpgid(sentinel));
}

TEST_F(GuardProcess, WithoutDescriptorsItAnswersItsClientAndDoesNotSpin) {
  start();
  g::Client driver = client();
  drive(driver);
  const std::string files = "/proc/" + std::to_string(guardPid()) + "/fd";
  const auto open = std::distance(fs::directory_iterator(files), fs::directory_iterator());
  const rlimit none{static_cast<rlim_t>(open), static_cast<rlim_t>(open)};
  ASSERT_EQ(prlimit(guardPid(), RLIMIT_NOFILE, &none, nullptr), 0);
  const double used = cpuOf(guardPid());
  const double begin = kurumaisu::steadyTime();
  for (int i = 0; i < 5; ++i) {  // the spare descriptor serves one at a time
    g::Client second = client();
    putUntil(driver, 0.4, [&second](const g::Status&) {
      return second.put({0, 0, 2.5}).reason == g::Reason::kBusy;
    });
  }
  const std::vector<kurumaisu::Descriptor> more = [&] {
    std::vector<kurumaisu::Descriptor> result;
    result.reserve(5);
    for (int i = 0; i < 5; ++i) result.push_back(g::connectTo(settings.socket));
    return result;
  }();
  for (int i = 0; i < 50; ++i, pause(kPeriod)) EXPECT_TRUE(driver.put({0.4, 0, 2.5}).connected);
  EXPECT_EQ(driver.status().state, g::State::kArmed);
  EXPECT_LT(cpuOf(guardPid()) - used, 0.5 * (kurumaisu::steadyTime() - begin));
}

TEST_F(GuardProcess, TheSocketIsForOwnerAndGroupAndForOneGuard) {
  start();
  struct stat status {};
  ASSERT_EQ(stat(settings.socket.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0660U);
  waitFor([&] { return static_cast<bool>(g::connectTo(settings.socket)); }, "a guard that listens");
  EXPECT_THROW(g::listenAt(settings.socket), std::system_error);
  EXPECT_THROW(g::listenAt(""), std::invalid_argument);
  EXPECT_THROW(g::listenAt(std::string(108, 'a')), std::invalid_argument);
  end(SIGKILL);
  waitFor([&] { return !g::connectTo(settings.socket); }, "the guard's end");
  start();  // in place of the socket that was left behind
  g::Client driver = client();
  putUntil(driver, 0, [](const g::Status& s) { return s.connected; });
}

TEST_F(GuardProcess, NeutralCanBeForcedWhenNobodyIsLeft) {
  EXPECT_TRUE(g::forceNeutral(settings, board.opener(), 0));
  EXPECT_TRUE(isNeutral(board->last().volts));
  board->unplugged = true;
  const double begin = kurumaisu::steadyTime();
  EXPECT_FALSE(g::forceNeutral(settings, board.opener(), 0.2));
  EXPECT_LT(kurumaisu::steadyTime() - begin, 0.2 + kSoon);
  EXPECT_GT(kurumaisu::steadyTime() - begin, 0.1);
}

TEST_F(GuardProcess, TellsSystemdThatItIsReadyAndAlive) {
  const std::string path = folder / "notify";
  const kurumaisu::Descriptor systemd(socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, path.size());
  ASSERT_EQ(bind(systemd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  start();
  unsetenv("NOTIFY_SOCKET");
  for (const std::string expected : {"READY=1", "WATCHDOG=1", "WATCHDOG=1"}) {
    std::string heard;
    waitFor(
        [&] {
          heard.resize(100);
          const ssize_t size = recv(systemd.get(), heard.data(), heard.size(), 0);
          heard.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
          return size > 0;
        },
        "a word to systemd");
    EXPECT_EQ(heard, expected);
  }
}

}  // namespace test_guard_server
