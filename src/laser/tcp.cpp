// SPDX-License-Identifier: BSD-3-Clause
#include "laser/tcp.h"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <memory>

namespace kurumaisu::laser {
namespace {

constexpr double kTcpSlice = 0.05;  // [s] between two looks whether to go on

using Address = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

/// In numbers only: to look a name up may take longer than any deadline here.
Address addressOf(const std::string& address, int port) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) {
    throw LinkLost("LASER_NO_PORT: ip_address " + address + " is not a numeric address");
  }
  return {found, &freeaddrinfo};
}

int openSocket(const addrinfo& address) {
  const int fd = socket(address.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) throw LinkLost("LASER_NO_PORT: " + serial::systemError(errno));
  return fd;
}

}  // namespace

Tcp::Tcp(const std::string& address, int port, double timeout, const std::function<bool()>& interrupted)
    : socket_(openSocket(*addressOf(address, port)), kWho) {
  const std::string name = "LASER_NO_PORT: " + address + ":" + std::to_string(port) + ": ";
  const Address target = addressOf(address, port);
  int code = connect(socket_.fd(), target->ai_addr, target->ai_addrlen) == 0 ? 0 : errno;
  if (code == EINPROGRESS) {
    for (const double until = steadyTime() + timeout;
         !socket_.wait(POLLOUT, std::min(kTcpSlice, until - steadyTime()));) {
      if (interrupted()) throw LinkLost(name + "interrupted");
      if (steadyTime() >= until) throw LinkLost(name + "no answer in " + std::to_string(timeout) + " s");
    }
    socklen_t size = sizeof(code);
    getsockopt(socket_.fd(), SOL_SOCKET, SO_ERROR, &code, &size);
  }
  if (code != 0) throw LinkLost(name + serial::systemError(code));
  const int yes = 1;
  setsockopt(socket_.fd(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
}

std::size_t Tcp::read(char* buffer, std::size_t size, double timeout) {
  return socket_.read(buffer, size, timeout);
}

void Tcp::write(std::string_view bytes, double timeout) { socket_.write(bytes, timeout, true); }

}  // namespace kurumaisu::laser
