// SPDX-License-Identifier: BSD-3-Clause
#include "laser/lock.h"

#include <sys/file.h>
#include <sys/ioctl.h>

#include <cerrno>

#include "laser/descriptor.h"
#include "laser/port.h"

namespace kurumaisu::laser {

void lock(int fd, const std::string& path) {
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK)
      throw PortInUse("LASER_IN_USE: another program, perhaps another driver, holds " + path);
    throw LinkLost("LASER_NO_PORT: " + path + " cannot be locked: " + systemError(errno));
  }
  if (ioctl(fd, TIOCEXCL) != 0) {
    throw LinkLost("LASER_NO_PORT: " + path + " cannot be taken for one alone: " + systemError(errno));
  }
}

void unlock(int fd) {
  ioctl(fd, TIOCNXCL);
  flock(fd, LOCK_UN);
}

}  // namespace kurumaisu::laser
