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

std::string partOf(const std::string& path) { return path + ".part"; }

int writeError(const std::string& part, const std::function<bool(const std::string&)>& write) {
  const int error = openError(part);
  if (error != 0) return error;
  errno = 0;
  bool written = false;
  try {
    written = write(part);
  } catch (const std::exception&) {  // MRPT's, whose text is a call stack
    written = false;
  }
  if (!written) return errno != 0 ? errno : EIO;
  return syncError(part);
}

}  // namespace

void replaceWhole(const std::vector<WholeFile>& files) {
  std::size_t at = 0;
  int error = 0;
  for (; at < files.size() && error == 0; ++at) error = writeError(partOf(files[at].path), files[at].write);
  for (std::size_t i = 0; i < files.size() && error == 0; ++i) {
    at = i + 1;
    if (std::rename(partOf(files[i].path).c_str(), files[i].path.c_str()) != 0) error = errno;
  }
  if (error == 0) return;
  for (const WholeFile& file : files) std::remove(partOf(file.path).c_str());
  throw std::runtime_error(files[at - 1].path + ": cannot be written: " + std::strerror(error));
}

WholeFile textFile(const std::string& path, const std::string& contents) {
  return {path, [contents](const std::string& name) {
            std::ofstream file(name, std::ios::binary);
            file << contents << std::flush;
            return file.good();
          }};
}

}  // namespace kurumaisu
