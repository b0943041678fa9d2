// SPDX-License-Identifier: BSD-3-Clause
// Local sockets that keep messages apart (SOCK_SEQPACKET), by path. None of them blocks.
#pragma once

#include <cstddef>
#include <string>

#include "file_descriptor.h"

namespace kurumaisu::guard {

/// Listens at a path that only owner and group may use, in place of a socket that a dead process left. Throws
/// std::invalid_argument for a path that cannot be one, std::system_error where somebody listens already.
Descriptor listenAt(const std::string& path);

/// Connects; none if nobody listens. Throws std::invalid_argument for a path that cannot be one.
Descriptor connectTo(const std::string& path);

enum class Sent { kYes, kFull, kGone };

/// Sends a message without waiting and without SIGPIPE.
Sent send(const Descriptor& socket, const void* message, std::size_t size);

enum class Heard { kMessage, kNothing, kGone };

/// Receives a message without waiting. size: of the buffer before, of the message after, which may be larger.
Heard receive(const Descriptor& socket, void* buffer, std::size_t& size);

}  // namespace kurumaisu::guard
