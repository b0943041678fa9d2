// SPDX-License-Identifier: BSD-3-Clause
// Descriptors 0 to 2, which belong to the standard streams, whoever has closed them before the program began.
#pragma once

#include <fcntl.h>

namespace kurumaisu {

/// Opens /dev/null in the place of those that are closed: else a device, or a socket, takes the number, and a message
/// for the standard error goes to it. To be called before anything is opened.
inline void holdStandardStreams() {
  for (int fd = 0; fd <= 2; ++fd) {
    if (fcntl(fd, F_GETFD) < 0) open("/dev/null", O_RDWR);  // the lowest number that is free: this one
  }
}

}  // namespace kurumaisu
