// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/pty.h"

#include <asm/termbits.h>  // not <termios.h>: that one cannot say 250000 baud
#include <fcntl.h>
#include <poll.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>

#include <array>
#include <cstdlib>
#include <filesystem>

namespace kurumaisu::virtual_urg {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPiece = 4096;  // [bytes] read at once

/// Bytes as they are: no echo, no lines, no signals, no flow control.
void makeRaw(int terminal) {
  termios2 settings{};
  checked(ioctl(terminal, TCGETS2, &settings), "TCGETS2");
  settings.c_iflag &= ~(IGNBRK | BRKINT | PARMRK | ISTRIP | INLCR | IGNCR | ICRNL | IXON | IXOFF);
  settings.c_oflag &= ~OPOST;
  settings.c_lflag &= ~(ECHO | ECHONL | ICANON | ISIG | IEXTEN);
  settings.c_cflag = (settings.c_cflag & ~(CSIZE | PARENB)) | CS8;
  checked(ioctl(terminal, TCSETS2, &settings), "TCSETS2");
}

std::string nameOf(int master) {
  int number = 0;
  checked(ioctl(master, TIOCGPTN, &number), "TIOCGPTN");
  return "/dev/pts/" + std::to_string(number);
}

}  // namespace

Pty::Pty(std::string link) : link_(std::move(link)) { plug(); }

Pty::~Pty() { removeLink(); }

int Pty::descriptor() const {
  if (ignoring_) return -1;
  return connected_ ? master_.get() : watch_.get();
}

void Pty::open() {
  Descriptor master(checked(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC), "a new terminal"));
  const int unlock = 0;
  checked(ioctl(master.get(), TIOCSPTLCK, &unlock), "TIOCSPTLCK");
  makeRaw(master.get());
  terminal_ = nameOf(master.get());
  // Closed once, it reports a hang-up until a client comes, as between two clients.
  Descriptor(checked(::open(terminal_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC), terminal_)).close();
  Descriptor watch(checked(inotify_init1(IN_NONBLOCK | IN_CLOEXEC), "inotify"));
  checked(inotify_add_watch(watch.get(), terminal_.c_str(), IN_OPEN), terminal_);
  master_ = std::move(master);
  watch_ = std::move(watch);
}

void Pty::putLink() {
  std::error_code error;
  fs::create_symlink(terminal_, link_, error);
  if (!error) return;
  const bool stale = error == std::errc::file_exists && fs::is_symlink(link_) && !fs::exists(link_);
  if (!stale) throw std::system_error(error, link_);
  const std::string fresh = link_ + "." + terminal_.substr(terminal_.rfind('/') + 1);
  fs::create_symlink(terminal_, fresh);
  fs::rename(fresh, link_);
}

void Pty::removeLink() const {
  std::error_code error;
  if (fs::read_symlink(link_, error) == terminal_ && !error) fs::remove(link_, error);
}

bool Pty::hungUp() const {
  pollfd state{master_.get(), 0, 0};
  return ::poll(&state, 1, 0) > 0 && (state.revents & POLLHUP) != 0;
}

bool Pty::accept() {
  std::array<char, kPiece> events;  // which one is all the same: that the terminal is open says hungUp()
  while (::read(watch_.get(), events.data(), events.size()) > 0) {
  }
  connected_ = !hungUp();
  return connected_;
}

void Pty::leave() {
  connected_ = false;
  makeRaw(master_.get());
  // What the last client has not read is not the next one's.
  const Descriptor slave(::open(terminal_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  if (slave) ioctl(slave.get(), TCFLSH, TCIFLUSH);
}

std::optional<std::string> Pty::read() {
  std::string bytes(kPiece, '\0');
  const ssize_t count = ::read(master_.get(), bytes.data(), bytes.size());
  if (count > 0) {
    bytes.resize(static_cast<std::size_t>(count));
    return bytes;
  }
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return "";
  leave();  // EIO: nobody has the terminal open
  return std::nullopt;
}

std::optional<std::size_t> Pty::write(std::string_view bytes) {
  if (hungUp()) {  // or it would be kept for the next client
    leave();
    return std::nullopt;
  }
  const ssize_t count = ::write(master_.get(), bytes.data(), bytes.size());
  return count < 0 ? 0 : static_cast<std::size_t>(count);
}

int Pty::rate() const {
  termios2 settings{};
  return ioctl(master_.get(), TCGETS2, &settings) < 0 ? 0 : static_cast<int>(settings.c_ospeed);
}

void Pty::close() {
  unplug();
  plug();
}

void Pty::unplug() {
  removeLink();
  connected_ = false;
  // The old terminal goes when the new one is there, or the new one could get its number.
  const Descriptor old_master = std::move(master_);
  const Descriptor old_watch = std::move(watch_);
  open();
}

void Pty::plug() {
  if (!master_) open();
  putLink();
}

}  // namespace kurumaisu::virtual_urg
