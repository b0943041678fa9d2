// SPDX-License-Identifier: BSD-3-Clause
// A pseudo terminal that a client takes for the sensor's serial port.
#pragma once

#include <string>

#include "file_descriptor.h"
#include "virtual_urg/endpoint.h"

namespace kurumaisu::virtual_urg {

/// A link of a chosen name leads to the terminal, as udev's do.
class Pty final : public Endpoint {
 public:
  /// Puts the link. Throws std::system_error where there is something else of that name, or a link to what is there.
  explicit Pty(std::string link);
  ~Pty() override;

  std::string address() const override { return link_; }
  int descriptor() const override;
  bool connected() const override { return connected_; }
  bool accept() override;
  std::optional<std::string> read() override;
  std::optional<std::size_t> write(std::string_view bytes) override;
  int rate() const override;
  bool tellsLeaving() const override { return false; }
  void close() override;
  void reset() override { close(); }
  void unplug() override;
  void plug() override;
  void ignore() override { ignoring_ = true; }

  /// The terminal that the link leads to: /dev/pts/N.
  const std::string& terminal() const { return terminal_; }

 private:
  void open();
  void putLink();
  void removeLink() const;
  bool hungUp() const;
  void leave();

  std::string link_;
  std::string terminal_;
  Descriptor master_;
  Descriptor watch_;  // inotify: becomes readable when somebody opens the terminal
  bool connected_ = false;
  bool ignoring_ = false;
};

}  // namespace kurumaisu::virtual_urg
