// SPDX-License-Identifier: BSD-3-Clause
// A tty and a TCP connection as ports of the link: whose they are, and how they end.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <cerrno>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "laser/tcp.h"
#include "laser/tty.h"
#include "laser_peer.h"

namespace test_laser_ports {

namespace l = kurumaisu::laser;
using namespace kurumaisu::test;  // NOLINT(google-build-using-namespace)

TEST(Tty, IsForOneAlone) {
  const Pty pty;
  std::optional<l::Tty> first(std::in_place, pty.path(), kBaud);
  const std::string refusal = problem([&] { l::Tty(pty.path(), kBaud); });
  EXPECT_TRUE(has(refusal, "LASER_IN_USE") && has(refusal, pty.path())) << refusal;
  EXPECT_THROW(l::Tty(pty.path(), kBaud), l::PortInUse);
  first.reset();
  EXPECT_NO_THROW(l::Tty(pty.path(), kBaud));
}

TEST(Tty, PassesEveryByteAndSetsTheRate) {
  const Pty pty;
  l::Tty tty(pty.path(), kBaud);
  EXPECT_EQ(pty.speed(), static_cast<speed_t>(B115200));
  tty.setBaud(19200);
  EXPECT_EQ(pty.speed(), static_cast<speed_t>(B19200));
  tty.setBaud(750000);  // has no name
  tty.setBaud(kBaud);
  std::string all;
  for (int byte = 0; byte < 256; ++byte) all += static_cast<char>(byte);
  tty.write(all, 1);
  std::string there(256, '\0');
  ASSERT_EQ(read(pty.fd(), there.data(), there.size()), 256);
  EXPECT_EQ(there, all);
  ASSERT_EQ(write(pty.fd(), all.data(), all.size()), 256);
  std::string back(300, '\0');
  ASSERT_EQ(tty.read(back.data(), back.size(), 1), 256U);
  EXPECT_EQ(back.substr(0, 256), all);
  EXPECT_EQ(tty.read(back.data(), back.size(), 0.01), 0U);
}

TEST(Tty, TellsOfAHangUpAndOfAPortThatIsNotThere) {
  Pty pty;
  l::Tty tty(pty.path(), kBaud);
  pty.hangUp();
  char byte = 0;
  EXPECT_THROW(tty.read(&byte, 1, 1), l::LinkLost);
  EXPECT_THROW(tty.write("QT\n", 1), l::LinkLost);
  const std::string refusal = problem([] { l::Tty("/dev/no_such_tty", kBaud); });
  EXPECT_TRUE(has(refusal, "LASER_NO_PORT") && has(refusal, "/dev/no_such_tty")) << refusal;
}

TEST(Tty, DoesNotBlockWhereNobodyReads) {
  const Pty pty;
  l::Tty tty(pty.path(), kBaud);
  const std::string much(1 << 20, 'x');
  const double time = seconds([&] { EXPECT_THROW(tty.write(much, 0.1), l::LinkLost); });
  EXPECT_LT(time, 0.5);
}

namespace {

const auto kGoOn = [] { return false; };

/// A listening socket on a free port of the loopback.
class Listener {
 public:
  explicit Listener(int backlog) : fd_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    if (bind(fd_, reinterpret_cast<sockaddr*>(&address), size) != 0 || listen(fd_, backlog) != 0 ||
        getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
      throw std::runtime_error("no listener");
    }
    port = ntohs(address.sin_port);
  }
  ~Listener() { close(fd_); }
  int accept() const { return ::accept(fd_, nullptr, nullptr); }
  int port = 0;

 private:
  int fd_;
};

}  // namespace

TEST(Tcp, GivesUpABlackHoleInTimeOrWhenTold) {
  const Listener full(0);
  std::vector<std::unique_ptr<l::Tcp>> crowd;  // a queue that is full drops who knocks
  std::string refusal;
  const double time = seconds([&] {
    refusal = problem([&] {
      for (int i = 0; i < 8; ++i)
        crowd.push_back(std::make_unique<l::Tcp>("127.0.0.1", full.port, 0.3, kGoOn));
    });
  });
  EXPECT_TRUE(has(refusal, "LASER_NO_PORT") && has(refusal, "no answer")) << refusal;
  EXPECT_GE(time, 0.3);
  EXPECT_LT(time, 0.6);
  const double interrupted =
      seconds([&] { EXPECT_THROW(l::Tcp("127.0.0.1", full.port, 60, [] { return true; }), l::LinkLost); });
  EXPECT_LT(interrupted, 0.3);
}

TEST(Tcp, TellsOfClosingAndOfAResetWithoutASignal) {
  const Listener listener(4);
  l::Tcp closed("127.0.0.1", listener.port, 1, kGoOn);
  close(listener.accept());
  char byte = 0;
  EXPECT_THROW(closed.read(&byte, 1, 1), l::LinkLost);

  l::Tcp reset("127.0.0.1", listener.port, 1, kGoOn);
  const int there = listener.accept();
  const linger now{1, 0};
  setsockopt(there, SOL_SOCKET, SO_LINGER, &now, sizeof(now));
  close(there);
  EXPECT_THROW(
      {
        for (int i = 0; i < 100; ++i) reset.write("QT\n", 1);
      },
      l::LinkLost);
  EXPECT_TRUE(has(problem([] { l::Tcp("sensor.local", 10940, 1, kGoOn); }), "sensor.local"));
}

}  // namespace test_laser_ports
