// SPDX-License-Identifier: BSD-3-Clause
#include "dac/sysfs.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "dac/converter.h"

namespace kurumaisu::dac {
namespace {

Fault faultOf(int code, const std::string& file) {
  const bool is_gone = code == ENOENT || code == ENODEV || code == ENXIO;
  const bool is_denied = code == EACCES || code == EPERM;
  const std::string name = is_gone ? "DAC_CLOSED: " : is_denied ? "DAC_NO_PORT: " : "DAC_REFUSED: ";
  return Fault(name + file + ": " + serial::systemError(code));
}

int openFolder(const std::string& folder) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) throw Fault("DAC_NO_PORT: " + folder + ": " + serial::systemError(errno));
  return fd;
}

}  // namespace

Attributes::Attributes(const std::string& folder) : folder_(folder), directory_(openFolder(folder), "DAC") {
  if (flock(directory_.fd(), LOCK_EX | LOCK_NB) == 0) return;
  if (errno == EWOULDBLOCK) throw Fault("DAC_IN_USE: another program holds " + folder);
  throw Fault("DAC_NO_PORT: " + folder + " cannot be locked: " + serial::systemError(errno));
}

std::optional<std::string> Attributes::readIfThere(const std::string& name) const {
  const int fd = openat(directory_.fd(), name.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0 && errno == ENOENT) return std::nullopt;
  if (fd < 0) throw faultOf(errno, folder_ + "/" + name);
  const serial::Descriptor file(fd, "DAC");
  std::array<char, 256> text;
  const ssize_t count = ::read(fd, text.data(), text.size());
  if (count < 0) throw faultOf(errno, folder_ + "/" + name);
  std::string result(text.data(), static_cast<std::size_t>(count));
  while (!result.empty() && result.back() == '\n') result.pop_back();
  return result;
}

std::string Attributes::read(const std::string& name) const {
  if (std::optional<std::string> text = readIfThere(name)) return *text;
  throw faultOf(ENOENT, folder_ + "/" + name);
}

void Attributes::write(const std::string& name, const std::string& text) const {
  const int fd = openat(directory_.fd(), name.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (fd < 0) throw faultOf(errno, folder_ + "/" + name);
  const serial::Descriptor file(fd, "DAC");
  const ssize_t count = ::write(fd, text.data(), text.size());
  if (count < 0) throw faultOf(errno, folder_ + "/" + name);
  if (static_cast<std::size_t>(count) != text.size()) throw faultOf(EIO, folder_ + "/" + name);
}

}  // namespace kurumaisu::dac
