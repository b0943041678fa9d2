// SPDX-License-Identifier: BSD-3-Clause
#include "serial/descriptor.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <system_error>

#include "serial/port.h"

namespace kurumaisu::serial {
namespace {

bool isTemporary(int code) { return code == EAGAIN || code == EWOULDBLOCK || code == EINTR; }

}  // namespace

std::string systemError(int code) { return std::system_category().message(code); }

bool Descriptor::wait(short events, double timeout) const {
  pollfd waiting{fd(), events, 0};
  const int ready = poll(&waiting, 1, static_cast<int>(std::ceil(1e3 * std::max(timeout, 0.0))));
  if (ready < 0 && errno != EINTR) throw LinkLost("poll: " + systemError(errno));
  return ready > 0;
}

std::size_t Descriptor::read(char* buffer, std::size_t size, double timeout) const {
  if (!wait(POLLIN, timeout)) return 0;
  const ssize_t count = ::read(fd(), buffer, size);
  if (count > 0) return static_cast<std::size_t>(count);
  if (count == 0) throw LinkLost(who_ + "_CLOSED: the other end has closed the connection");
  if (isTemporary(errno)) return 0;
  throw LinkLost(who_ + "_CLOSED: " + systemError(errno));
}

void Descriptor::write(std::string_view bytes, double timeout, bool is_socket) const {
  bool is_late = false;  // by the clock, too: a line may take nothing though poll() says that it would
  for (const double until = steadyTime() + timeout; !bytes.empty(); is_late = steadyTime() > until) {
    if (is_late || !wait(POLLOUT, until - steadyTime())) {
      throw LinkLost(who_ + "_BLOCKED: nothing can be sent for " + std::to_string(timeout) + " s");
    }
    const ssize_t count = is_socket ? send(fd(), bytes.data(), bytes.size(), MSG_NOSIGNAL)
                                    : ::write(fd(), bytes.data(), bytes.size());
    if (count < 0 && !isTemporary(errno)) throw LinkLost(who_ + "_CLOSED: " + systemError(errno));
    if (count > 0) bytes.remove_prefix(static_cast<std::size_t>(count));
  }
}

}  // namespace kurumaisu::serial
