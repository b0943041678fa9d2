// SPDX-License-Identifier: BSD-3-Clause
// One owner for a tty.
#pragma once

#include <string>

namespace kurumaisu::serial {

/// Takes an open tty for this program alone, until it is closed. Throws PortInUse naming the tty; codes begin with who.
///
/// Against those that ask (flock, root too), and against those that do not (TIOCEXCL, which does not stop root).
void lock(int fd, const std::string& path, const std::string& who);

/// Lets others open it again, which the driver of some ttys does not do by itself.
void unlock(int fd);

}  // namespace kurumaisu::serial
