// SPDX-License-Identifier: BSD-3-Clause
// Ends another thread's poll.
#pragma once

#include <sys/eventfd.h>

#include <cstdint>

#include "file_descriptor.h"

namespace kurumaisu::virtual_urg {

/// An event that stays until it is cleared.
class Wake {
 public:
  int descriptor() const { return event_.get(); }
  void set() const { eventfd_write(event_.get(), 1); }
  void clear() const {
    std::uint64_t ignored = 0;
    eventfd_read(event_.get(), &ignored);
  }

 private:
  Descriptor event_{checked(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC), "eventfd")};
};

}  // namespace kurumaisu::virtual_urg
