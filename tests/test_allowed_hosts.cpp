// SPDX-License-Identifier: BSD-3-Clause
// Which hosts may talk to base_node: addresses and networks, of either kind of IP.
#include <arpa/inet.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "base/node/allowed_hosts.h"

namespace {

using kurumaisu::AllowedHosts;

sockaddr_storage at(const std::string& host) {
  sockaddr_storage result{};
  auto& four = reinterpret_cast<sockaddr_in&>(result);
  auto& six = reinterpret_cast<sockaddr_in6&>(result);
  four.sin_port = htons(1234);
  if (inet_pton(AF_INET, host.c_str(), &four.sin_addr) == 1) {
    four.sin_family = AF_INET;
  } else {
    EXPECT_EQ(inet_pton(AF_INET6, host.c_str(), &six.sin6_addr), 1) << host;
    six.sin6_family = AF_INET6;
  }
  return result;
}

const sockaddr& plain(const sockaddr_storage& address) { return reinterpret_cast<const sockaddr&>(address); }

bool allowed(const std::vector<std::string>& entries, const std::string& host) {
  return AllowedHosts(entries).allows(plain(at(host)));
}

TEST(AllowedHosts, NobodyUnlessNamed) {
  EXPECT_FALSE(allowed({}, "192.168.1.20"));
  EXPECT_TRUE(allowed({"10.0.0.1", "192.168.1.20"}, "192.168.1.20"));
  EXPECT_FALSE(allowed({"10.0.0.1", "192.168.1.20"}, "192.168.1.21"));
  EXPECT_FALSE(allowed({"::"}, "192.168.1.20"));
  EXPECT_TRUE(allowed({"any"}, "192.168.1.20"));
  EXPECT_TRUE(allowed({"any"}, "2001:db8::1"));
}

TEST(AllowedHosts, NetworksEndWhereTheirBitsEnd) {
  for (const char* host : {"192.168.1.0", "192.168.1.255"}) EXPECT_TRUE(allowed({"192.168.1.0/24"}, host));
  EXPECT_FALSE(allowed({"192.168.1.0/24"}, "192.168.2.0"));
  EXPECT_TRUE(allowed({"192.168.1.128/25"}, "192.168.1.128"));
  EXPECT_FALSE(allowed({"192.168.1.128/25"}, "192.168.1.127"));
  EXPECT_TRUE(allowed({"10.0.0.0/31"}, "10.0.0.1"));
  EXPECT_FALSE(allowed({"10.0.0.0/31"}, "10.0.0.2"));
  EXPECT_TRUE(allowed({"0.0.0.0/0"}, "8.8.8.8"));
  EXPECT_FALSE(allowed({"0.0.0.0/0"}, "2001:db8::1"));
  EXPECT_TRUE(allowed({"2001:db8::/32"}, "2001:db8:ffff::1"));
  EXPECT_FALSE(allowed({"2001:db8::/32"}, "2001:db9::1"));
}

TEST(AllowedHosts, AnAddressOfIPv4WithinIPv6IsTheSame) {
  EXPECT_TRUE(allowed({"192.168.1.20"}, "::ffff:192.168.1.20"));
  EXPECT_TRUE(allowed({"::ffff:192.168.1.20"}, "192.168.1.20"));
}

TEST(AllowedHosts, WhatIsNoEntryIsNamed) {
  for (const char* entry :
       {"", "laptop", "192.168.1", "192.168.1.0/", "192.168.1.0/33", "::1/129", "1.2.3.4/-1", "1.2.3.4/8x",
        "/8", "Any", "1.2.3.4 ", "1.2.3.4/99999999999999999999"}) {
    try {
      const AllowedHosts hosts({entry});
      ADD_FAILURE() << entry;
    } catch (const AllowedHosts::Unknown& error) {
      EXPECT_NE(std::string(error.what()).find(std::string("not ") + entry), std::string::npos)
          << error.what();
    }
  }
}

TEST(AllowedHosts, LoopbackAndOwn) {
  for (const char* host : {"127.0.0.1", "127.8.9.10", "::1", "::ffff:127.0.0.1"})
    EXPECT_TRUE(kurumaisu::isLoopback(plain(at(host))));
  for (const char* host : {"128.0.0.1", "126.255.255.255", "::2"})
    EXPECT_FALSE(kurumaisu::isLoopback(plain(at(host))));
  EXPECT_TRUE(kurumaisu::isOwn(plain(at("127.0.0.1"))));
  EXPECT_FALSE(kurumaisu::isOwn(plain(at("192.0.2.1"))));
}

TEST(AllowedHosts, AFileIsNoHost) {
  sockaddr_storage file{};
  file.ss_family = AF_UNIX;
  EXPECT_TRUE(AllowedHosts({}).allows(plain(file)));
  EXPECT_EQ(kurumaisu::shownHost(plain(file)), "a file");
  EXPECT_EQ(kurumaisu::shownHost(plain(at("192.168.1.20"))), "192.168.1.20");
  EXPECT_EQ(kurumaisu::shownHost(plain(at("2001:db8::1"))), "2001:db8::1");
}

}  // namespace
