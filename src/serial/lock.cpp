// SPDX-License-Identifier: BSD-3-Clause
#include "serial/lock.h"

#include <sys/file.h>
#include <sys/ioctl.h>

#include <cerrno>

#include "serial/descriptor.h"
#include "serial/port.h"

namespace kurumaisu::serial {

void lock(int fd, const std::string& path, const std::string& who) {
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK)
      throw PortInUse(who + "_IN_USE: another program, perhaps another driver, holds " + path);
    throw LinkLost(who + "_NO_PORT: " + path + " cannot be locked: " + systemError(errno));
  }
  if (ioctl(fd, TIOCEXCL) != 0) {
    throw LinkLost(who + "_NO_PORT: " + path + " cannot be taken for one alone: " + systemError(errno));
  }
}

void unlock(int fd) {
  ioctl(fd, TIOCNXCL);
  flock(fd, LOCK_UN);
}

}  // namespace kurumaisu::serial
