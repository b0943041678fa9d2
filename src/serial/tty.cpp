// SPDX-License-Identifier: BSD-3-Clause
#include "serial/tty.h"

#include <asm/termbits.h>  // termios2, for rates that have no name; excludes <termios.h>
#include <fcntl.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "serial/lock.h"

namespace kurumaisu::serial {
namespace {

struct Rate {
  int baud;
  tcflag_t name;
};

// Named where there is a name: what looks at a pty's rate may not understand the others.
constexpr std::array<Rate, 5> kNamed{
    {{19200, B19200}, {38400, B38400}, {57600, B57600}, {115200, B115200}, {500000, B500000}}};

constexpr double kDrainTime = 0.02;  // [s] three bytes at 19200 baud, and what a USB converter adds

tcflag_t nameOf(int baud) {
  const auto* const found =
      std::find_if(kNamed.begin(), kNamed.end(), [baud](const Rate& rate) { return rate.baud == baud; });
  return found == kNamed.end() ? BOTHER : found->name;
}

int openTty(const std::string& path, const std::string& who) {
  const int fd = open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd >= 0) return fd;
  if (errno == EBUSY) throw PortInUse(who + "_IN_USE: another program holds " + path);
  throw LinkLost(who + "_NO_PORT: " + path + ": " + systemError(errno));
}

/// Gives the last command time to leave. What a dead device does not take goes: closing would wait for it.
void drain(const Descriptor& tty) {
  for (const double until = steadyTime() + kDrainTime; steadyTime() < until;) {
    int waiting = 0;
    if (ioctl(tty.fd(), TIOCOUTQ, &waiting) != 0 || waiting == 0) return;
    tty.wait(0, kDrainTime / 10);
  }
  ioctl(tty.fd(), TCFLSH, TCOFLUSH);
}

}  // namespace

Tty::Tty(const std::string& path, int baud, const std::string& who)
    : path_(path), who_(who), tty_(openTty(path, who), who) {
  lock(tty_.fd(), path, who);
  Tty::setBaud(baud);
}

Tty::~Tty() {
  drain(tty_);
  unlock(tty_.fd());
}

std::size_t Tty::read(char* buffer, std::size_t size, double timeout) {
  return tty_.read(buffer, size, timeout);
}

void Tty::write(std::string_view bytes, double timeout) { tty_.write(bytes, timeout, false); }

void Tty::setBaud(int baud) {
  termios2 mode{};
  mode.c_cflag = CS8 | CREAD | CLOCAL | nameOf(baud);
  mode.c_ispeed = mode.c_ospeed = static_cast<speed_t>(baud);
  mode.c_cc[VMIN] = 1;
  if (ioctl(tty_.fd(), TCSETS2, &mode) != 0) {
    throw LinkLost(who_ + "_NO_PORT: " + path_ + " cannot be set to " + std::to_string(baud) +
                   " baud: " + systemError(errno));
  }
  ioctl(tty_.fd(), TCFLSH, TCIFLUSH);
}

}  // namespace kurumaisu::serial
