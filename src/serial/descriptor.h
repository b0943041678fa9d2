// SPDX-License-Identifier: BSD-3-Clause
// A file descriptor that does not block.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "file_descriptor.h"

namespace kurumaisu::serial {

/// What the system says of the last error: "No such file or directory".
std::string systemError(int code);

/// Owns a non-blocking descriptor, of a tty or a socket.
class Descriptor {
 public:
  /// who: what the codes of its errors begin with.
  Descriptor(int fd, std::string who) : fd_(fd), who_(std::move(who)) {}

  int fd() const { return fd_.get(); }

  /// Waits until it is ready for these events of poll(), at most so long [s].
  bool wait(short events, double timeout) const;

  /// As Port::read and Port::write. Neither raises SIGPIPE.
  std::size_t read(char* buffer, std::size_t size, double timeout) const;
  void write(std::string_view bytes, double timeout, bool is_socket) const;

 private:
  kurumaisu::Descriptor fd_;
  std::string who_;
};

}  // namespace kurumaisu::serial
