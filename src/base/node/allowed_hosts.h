// SPDX-License-Identifier: BSD-3-Clause
// Which computers may talk to this one, by their addresses.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

namespace kurumaisu {

/// An address of IPv4 or IPv6 as the sixteen bytes of IPv6.
using HostBytes = std::array<unsigned char, 16>;

/// An address and how many of its bits count.
struct Network {
  HostBytes bytes;
  int bits;
};

class AllowedHosts {
 public:
  /// What an entry says that is none of these.
  struct Unknown : std::invalid_argument {
    using std::invalid_argument::invalid_argument;
  };

  /// Each entry an address in numbers, a network like 192.168.1.0/24, or `any`. Throws Unknown.
  explicit AllowedHosts(const std::vector<std::string>& entries);

  /// Whether an address is on the list; of what is no address of the internet, like a file: yes.
  bool allows(const sockaddr& peer) const;

 private:
  std::vector<Network> networks_;
};

bool isLoopback(const sockaddr& address);

/// Whether this computer has the address at one of its interfaces.
bool isOwn(const sockaddr& address);

/// Whether two addresses are the same, whatever their ports.
bool isSameHost(const sockaddr& one, const sockaddr& other);

/// An address in numbers, for people.
std::string shownHost(const sockaddr& address);

}  // namespace kurumaisu
