// SPDX-License-Identifier: BSD-3-Clause
#include "guard/socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>

namespace kurumaisu::guard {
namespace {

constexpr int kWaiting = 8;                              // clients not yet accepted
constexpr mode_t kOthers = S_IRWXO | S_IXUSR | S_IXGRP;  // taken away: 0660 remains

sockaddr_un addressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) {
    throw std::invalid_argument("socket: not a path of 1 to " + std::to_string(sizeof address.sun_path - 1) +
                                " bytes: " + path);
  }
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

Descriptor open() {
  Descriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket) throw std::system_error(errno, std::generic_category(), "socket");
  return socket;
}

/// A socket file that nobody listens at any more is what a killed process leaves.
void removeStale(const std::string& path) {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0 || !S_ISSOCK(status.st_mode)) return;
  if (connectTo(path)) throw std::system_error(EADDRINUSE, std::generic_category(), path);
  unlink(path.c_str());
}

bool isPassing(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

}  // namespace

Descriptor listenAt(const std::string& path) {
  const sockaddr_un address = addressOf(path);
  removeStale(path);
  Descriptor socket = open();
  const mode_t before = umask(kOthers);
  const int bound = bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const int error = errno;
  umask(before);
  if (bound != 0) throw std::system_error(error, std::generic_category(), path);
  if (listen(socket.get(), kWaiting) != 0) throw std::system_error(errno, std::generic_category(), path);
  return socket;
}

Descriptor connectTo(const std::string& path) {
  const sockaddr_un address = addressOf(path);
  Descriptor socket = open();
  if (connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return Descriptor();
  return socket;
}

Sent send(const Descriptor& socket, const void* message, std::size_t size) {
  const ssize_t sent = ::send(socket.get(), message, size, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent >= 0) return Sent::kYes;
  return isPassing(errno) ? Sent::kFull : Sent::kGone;
}

Heard receive(const Descriptor& socket, void* buffer, std::size_t& size) {
  const ssize_t count = recv(socket.get(), buffer, size, MSG_DONTWAIT | MSG_TRUNC);
  if (count < 0) return isPassing(errno) ? Heard::kNothing : Heard::kGone;
  size = static_cast<std::size_t>(count);
  return count == 0 ? Heard::kGone : Heard::kMessage;
}

}  // namespace kurumaisu::guard
