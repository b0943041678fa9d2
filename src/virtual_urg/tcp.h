// SPDX-License-Identifier: BSD-3-Clause
// A TCP port for one client.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "file_descriptor.h"
#include "virtual_urg/endpoint.h"

namespace kurumaisu::virtual_urg {

/// Listens; while it has a client, the next one waits in the backlog.
class Tcp final : public Endpoint {
 public:
  /// host: an address in numbers; port 0: any that is free.
  Tcp(std::string host, std::uint16_t port);

  std::string address() const override { return host_ + ":" + std::to_string(port_); }
  int descriptor() const override;
  bool connected() const override { return static_cast<bool>(client_); }
  bool accept() override;
  std::optional<std::string> read() override;
  std::optional<std::size_t> write(std::string_view bytes) override;
  bool tellsLeaving() const override { return true; }
  void close() override { client_.close(); }
  void reset() override;
  void unplug() override;
  void plug() override { listen(kBacklog); }
  void ignore() override;

 private:
  static constexpr int kBacklog = 8;

  void listen(int backlog);

  std::string host_;
  std::uint16_t port_;
  Descriptor listener_;
  Descriptor client_;
  std::vector<Descriptor> fillers_;  // stand in the backlog, so that nobody else finds room
};

}  // namespace kurumaisu::virtual_urg
