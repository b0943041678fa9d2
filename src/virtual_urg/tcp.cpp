// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/tcp.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <array>
#include <stdexcept>

namespace kurumaisu::virtual_urg {
namespace {

// [bytes] that the system may hold for a client that does not read: a few scans, as in the sensor, not a minute of them.
constexpr int kSendBuffer = 16384;
constexpr std::size_t kTcpPiece = 4096;  // [bytes] read at once

sockaddr_in addressOf(const std::string& host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  if (inet_pton(AF_INET, host.c_str(), &address.sin_addr) != 1) {
    throw std::invalid_argument("host must be an address as 127.0.0.1: " + host);
  }
  return address;
}

void set(int socket, int level, int option, int value) {
  checked(setsockopt(socket, level, option, &value, sizeof value), "setsockopt");
}

bool later() { return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR; }

}  // namespace

Tcp::Tcp(std::string host, std::uint16_t port) : host_(std::move(host)), port_(port) { listen(kBacklog); }

void Tcp::listen(int backlog) {
  Descriptor socket(checked(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), "socket"));
  set(socket.get(), SOL_SOCKET, SO_REUSEADDR, 1);
  set(socket.get(), SOL_SOCKET, SO_SNDBUF, kSendBuffer);  // before it listens: clients inherit it
  sockaddr_in address = addressOf(host_, port_);
  socklen_t length = sizeof address;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  checked(bind(socket.get(), generic, length), "cannot listen at " + this->address());
  checked(::listen(socket.get(), backlog), "cannot listen at " + this->address());
  checked(getsockname(socket.get(), generic, &length), "getsockname");
  port_ = ntohs(address.sin_port);
  listener_ = std::move(socket);
}

int Tcp::descriptor() const {
  if (client_) return client_.get();
  return fillers_.empty() ? listener_.get() : -1;
}

bool Tcp::accept() {
  client_ = Descriptor(accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  const bool none = !client_ && (later() || errno == ECONNABORTED);
  if (none) return false;
  checked(client_.get(), "accept at " + address());  // with too many files open, say: it would go on for ever
  const int at_once = 1;
  setsockopt(client_.get(), IPPROTO_TCP, TCP_NODELAY, &at_once,
             sizeof at_once);  // in vain if it is gone again
  return true;
}

std::optional<std::string> Tcp::read() {
  std::string bytes(kTcpPiece, '\0');
  const ssize_t count = recv(client_.get(), bytes.data(), bytes.size(), 0);
  if (count > 0) {
    bytes.resize(static_cast<std::size_t>(count));
    return bytes;
  }
  if (count < 0 && later()) return "";
  client_.close();
  return std::nullopt;
}

std::optional<std::size_t> Tcp::write(std::string_view bytes) {
  const ssize_t count = send(client_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (count >= 0) return static_cast<std::size_t>(count);
  if (later()) return 0;
  client_.close();
  return std::nullopt;
}

void Tcp::reset() {
  if (!client_) return;
  const linger at_once{1, 0};  // what makes close() send RST
  setsockopt(client_.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  client_.close();
}

void Tcp::unplug() {
  listener_.close();  // first: whom the reset wakes must find nobody
  reset();
}

void Tcp::ignore() {
  client_.close();
  listener_.close();
  listen(0);
  const sockaddr_in address = addressOf(host_, port_);
  // A backlog of 0 holds one; the second's handshake stays half done, as every other's from then on.
  for (int i = 0; i < 2; ++i) {
    Descriptor filler(checked(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), "socket"));
    const int result = connect(filler.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
    if (result < 0 && errno != EINPROGRESS) checked(result, "connect to " + this->address());
    fillers_.push_back(std::move(filler));
  }
}

}  // namespace kurumaisu::virtual_urg
