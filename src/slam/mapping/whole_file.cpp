// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/whole_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace kurumaisu {
namespace {

/// Why a file cannot be written, and nothing else: it is made, or emptied.
int openError(const std::string& path) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) return errno;
  ::close(file);
  return 0;
}

int syncError(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return errno;
  const int error = ::fsync(file) == 0 ? 0 : errno;
  ::close(file);
  return error;
}

}  // namespace

void replaceWhole(const std::string& path, const std::function<bool(const std::string&)>& write) {
  const std::string other = path + ".part";
  int error = openError(other);
  if (error == 0 && !write(other)) error = errno != 0 ? errno : EIO;
  if (error == 0) error = syncError(other);
  if (error == 0 && std::rename(other.c_str(), path.c_str()) != 0) error = errno;
  if (error == 0) return;
  std::remove(other.c_str());
  throw std::runtime_error(path + ": cannot be written: " + std::strerror(error));
}

void writeWhole(const std::string& path, const std::string& contents) {
  replaceWhole(path, [&contents](const std::string& name) {
    std::ofstream file(name, std::ios::binary);
    file << contents << std::flush;
    return file.good();
  });
}

}  // namespace kurumaisu
