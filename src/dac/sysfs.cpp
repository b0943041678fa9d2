// SPDX-License-Identifier: BSD-3-Clause
#include "dac/sysfs.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "dac/converter.h"
#include "serial/descriptor.h"

namespace kurumaisu::dac {
namespace {

Fault faultOf(int code, const std::string& file) {
  const bool is_gone = code == ENOENT || code == ENODEV || code == ENXIO;
  const bool is_denied = code == EACCES || code == EPERM;
  const std::string name = is_gone ? "DAC_CLOSED: " : is_denied ? "DAC_NO_PORT: " : "DAC_REFUSED: ";
  return Fault(name + file + ": " + serial::systemError(code));
}

Descriptor openFolder(const std::string& folder) {
  Descriptor fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd) throw Fault("DAC_NO_PORT: " + folder + ": " + serial::systemError(errno));
  return fd;
}

}  // namespace

Attributes::Attributes(const std::string& folder) : folder_(folder), directory_(openFolder(folder)) {
  if (flock(directory_.get(), LOCK_EX | LOCK_NB) == 0) return;
  if (errno == EWOULDBLOCK) throw Fault("DAC_IN_USE: another program holds " + folder);
  throw Fault("DAC_NO_PORT: " + folder + " cannot be locked: " + serial::systemError(errno));
}

std::optional<std::string> Attributes::readIfThere(const std::string& name) const {
  const Descriptor file(openat(directory_.get(), name.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file && errno == ENOENT) return std::nullopt;
  if (!file) throw faultOf(errno, folder_ + "/" + name);
  std::array<char, 256> text;
  const ssize_t count = ::read(file.get(), text.data(), text.size());
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
  const Descriptor file(openat(directory_.get(), name.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC));
  if (!file) throw faultOf(errno, folder_ + "/" + name);
  const ssize_t count = ::write(file.get(), text.data(), text.size());
  if (count < 0) throw faultOf(errno, folder_ + "/" + name);
  if (static_cast<std::size_t>(count) != text.size()) throw faultOf(EIO, folder_ + "/" + name);
}

}  // namespace kurumaisu::dac
