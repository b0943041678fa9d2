// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/allowed_hosts.h"

#include <arpa/inet.h>
#include <ifaddrs.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>

namespace kurumaisu {
namespace {

constexpr int kMappedBits = 96;  // before an address of IPv4 within one of IPv6
constexpr int kAllBits = 128;
constexpr int kByte = 8;

HostBytes mapped(const void* four) {
  HostBytes bytes{};
  bytes[10] = bytes[11] = 0xff;
  std::memcpy(&bytes[12], four, 4);
  return bytes;
}

template <typename T>
T as(const sockaddr& address) {
  T result{};
  std::memcpy(&result, &address, sizeof result);
  return result;
}

std::optional<HostBytes> bytesOf(const sockaddr& address) {
  if (address.sa_family == AF_INET) {
    const in_addr host = as<sockaddr_in>(address).sin_addr;
    return mapped(&host);
  }
  if (address.sa_family != AF_INET6) return std::nullopt;
  const in6_addr host = as<sockaddr_in6>(address).sin6_addr;
  HostBytes bytes{};
  std::memcpy(bytes.data(), &host, bytes.size());
  return bytes;
}

bool isIn(const HostBytes& host, const Network& network) {
  for (int bit = 0; bit < network.bits; bit += kByte) {
    const auto i = static_cast<std::size_t>(bit / kByte);
    const int left = std::min(kByte, network.bits - bit);
    if (((host[i] ^ network.bytes[i]) >> (kByte - left)) != 0) return false;
  }
  return true;
}

AllowedHosts::Unknown wrong(const std::string& entry) {
  return AllowedHosts::Unknown(
      "must have addresses like 192.168.1.20, networks like 192.168.1.0/24, or `any`, not " + entry);
}

int bitsOf(const std::string& text, int most, const std::string& entry) {
  const bool digits = !text.empty() && text.size() <= 3 &&
                      std::all_of(text.begin(), text.end(), [](char c) { return '0' <= c && c <= '9'; });
  if (!digits || std::stoi(text) > most) throw wrong(entry);
  return std::stoi(text);
}

Network networkOf(const std::string& entry) {
  if (entry == "any") return {{}, 0};
  const std::size_t slash = entry.find('/');
  const std::string host = entry.substr(0, slash);
  HostBytes bytes{};
  in_addr four{};
  const bool is_four = inet_pton(AF_INET, host.c_str(), &four) == 1;
  if (is_four) bytes = mapped(&four);
  if (!is_four && inet_pton(AF_INET6, host.c_str(), bytes.data()) != 1) throw wrong(entry);
  if (slash == std::string::npos) return {bytes, kAllBits};
  const int before = is_four ? kMappedBits : 0;
  return {bytes, before + bitsOf(entry.substr(slash + 1), kAllBits - before, entry)};
}

}  // namespace

AllowedHosts::AllowedHosts(const std::vector<std::string>& entries) {
  for (const std::string& entry : entries) networks_.push_back(networkOf(entry));
}

bool AllowedHosts::allows(const sockaddr& peer) const {
  const std::optional<HostBytes> host = bytesOf(peer);
  if (!host) return true;
  return std::any_of(networks_.begin(), networks_.end(),
                     [&host](const Network& network) { return isIn(*host, network); });
}

bool isLoopback(const sockaddr& address) {
  static const AllowedHosts loopback({"127.0.0.0/8", "::1"});
  return loopback.allows(address);
}

bool isSameHost(const sockaddr& one, const sockaddr& other) {
  const std::optional<HostBytes> host = bytesOf(one);
  return host && host == bytesOf(other);
}

bool isOwn(const sockaddr& address) {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return false;
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, freeifaddrs);
  for (const ifaddrs* one = list; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr != nullptr && isSameHost(*one->ifa_addr, address)) return true;
  }
  return false;
}

std::string shownHost(const sockaddr& address) {
  const std::optional<HostBytes> host = bytesOf(address);
  if (!host) return "a file";
  std::array<char, INET6_ADDRSTRLEN> text{};
  const bool is_four = isIn(*host, {mapped("\0\0\0\0"), kMappedBits});
  inet_ntop(is_four ? AF_INET : AF_INET6, is_four ? &(*host)[12] : host->data(), text.data(), text.size());
  return text.data();
}

}  // namespace kurumaisu
