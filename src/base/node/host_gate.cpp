// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/host_gate.h"

#include <dlfcn.h>
#include <netdb.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/network.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <mutex>
#include <vector>

namespace kurumaisu {
namespace {

constexpr double kRefusalPeriod = 1.0;            // [s]
constexpr std::chrono::seconds kMasterPeriod{5};  // between questions for the master's address

/// The C library's own function of a name.
template <typename Function>
Function* original(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

bool isTcp(int fd, const sockaddr& address) {
  int type = 0;
  socklen_t size = sizeof type;
  return (address.sa_family == AF_INET || address.sa_family == AF_INET6) &&
         getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) == 0 && type == SOCK_STREAM;
}

class Gate {
 public:
  void allow(const AllowedHosts& hosts) {
    const std::lock_guard<std::mutex> lock(mutex_);
    allowed_ = hosts;
  }

  /// look_up: whether the master's name may be looked up, which takes time.
  bool lets(const sockaddr& peer, bool look_up) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (allowed_.allows(peer) || isLoopback(peer) || isOwn(peer) || isMaster(peer)) return true;
    if (!look_up || std::chrono::steady_clock::now() < next_) return false;
    lookUpMaster();
    return isMaster(peer);
  }

 private:
  bool isMaster(const sockaddr& peer) const {
    return std::any_of(master_.begin(), master_.end(), [&peer](const sockaddr_storage& address) {
      sockaddr_storage copy = address;
      return isSameHost(*reinterpret_cast<sockaddr*>(&copy), peer);
    });
  }

  void lookUpMaster() {
    next_ = std::chrono::steady_clock::now() + kMasterPeriod;
    addrinfo* list = nullptr;
    if (getaddrinfo(ros::master::getHost().c_str(), nullptr, nullptr, &list) != 0) return;
    const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> owner(list, freeaddrinfo);
    master_.clear();
    for (const addrinfo* one = list; one != nullptr; one = one->ai_next) {
      std::memcpy(&master_.emplace_back(), one->ai_addr, one->ai_addrlen);
    }
  }

  std::mutex mutex_;
  AllowedHosts allowed_{{}};
  std::vector<sockaddr_storage> master_;
  std::chrono::steady_clock::time_point next_;
};

/// There is one C library, so there is one gate.
Gate& gate() {
  static Gate one;
  return one;
}

/// Whether others know this computer by an address that only it can reach.
bool isForItselfOnly() {
  const std::string& host = ros::network::getHost();
  return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0;
}

void warnRefused(const sockaddr& peer, const char* what) {
  ROS_WARN_THROTTLE(
      kRefusalPeriod,
      "BASE_HOST_REFUSED: %s %s: it is neither this computer, nor the master's, nor in allowed_hosts", what,
      shownHost(peer).c_str());
}

}  // namespace

void allowHosts(const AllowedHosts& hosts) { gate().allow(hosts); }

}  // namespace kurumaisu

namespace k = kurumaisu;

// Each takes the place of the C library's function for all that this program loads.

extern "C" int bind(int fd, const sockaddr* address, socklen_t size) noexcept {
  static auto* const next = k::original<int(int, const sockaddr*, socklen_t)>("bind");
  sockaddr_storage own{};
  std::memcpy(&own, address, std::min<std::size_t>(size, sizeof own));
  auto& four = reinterpret_cast<sockaddr_in&>(own);
  auto& six = reinterpret_cast<sockaddr_in6&>(own);
  if (k::isTcp(fd, *address) && k::isForItselfOnly()) {
    if (own.ss_family == AF_INET && four.sin_addr.s_addr == htonl(INADDR_ANY))
      four.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (own.ss_family == AF_INET6 && IN6_IS_ADDR_UNSPECIFIED(&six.sin6_addr))
      six.sin6_addr = in6addr_loopback;
  }
  return next(fd, reinterpret_cast<const sockaddr*>(&own), size);
}

extern "C" int accept(int fd, sockaddr* address, socklen_t* size) {
  static auto* const next = k::original<int(int, sockaddr*, socklen_t*)>("accept");
  const int link = next(fd, address, size);
  if (link < 0) return link;
  sockaddr_storage peer{};
  socklen_t length = sizeof peer;
  auto& from = reinterpret_cast<sockaddr&>(peer);
  const bool known = getpeername(link, &from, &length) == 0;
  if (known && (!k::isTcp(link, from) || k::gate().lets(from, false))) return link;
  close(link);
  if (known) k::warnRefused(from, "a connection from");
  errno = ECONNABORTED;
  return -1;
}

extern "C" int connect(int fd, const sockaddr* address, socklen_t size) {
  static auto* const next = k::original<int(int, const sockaddr*, socklen_t)>("connect");
  if (!k::isTcp(fd, *address) || k::gate().lets(*address, true)) return next(fd, address, size);
  k::warnRefused(*address, "a connection to");
  errno = EACCES;
  return -1;
}
