// SPDX-License-Identifier: BSD-3-Clause
// A simulated D/A chip, as Linux's IIO would show it: a folder of attributes, for tests and the guard's benchmark.
#pragma once

#include <filesystem>
#include <mutex>
#include <string>
#include <thread>

#include "dac/settings.h"
#include "dac/virtual/outputs.h"
#include "file_descriptor.h"
#include "virtual_urg/wake.h"

namespace kurumaisu::dac {

/// Runs from its construction to its end, in a thread of its own. It puts out what the attributes _raw say as soon as
/// it sees them: what is overwritten before does not show. Its range is 0 V to 5 V. Powering up and down means nothing.
class VirtualChip {
 public:
  /// root: a folder that is made for it, where the device's file says that devices are. log: as of VirtualBoard.
  /// Throws std::invalid_argument for a device that is not IIO's or is named by its folder, std::system_error.
  VirtualChip(const Device& device, const std::string& root, const std::string& log);
  ~VirtualChip();
  VirtualChip(const VirtualChip&) = delete;
  VirtualChip& operator=(const VirtualChip&) = delete;

  /// "unplug=SECONDS": gone for so long. Throws std::invalid_argument for anything else.
  void inject(const std::string& fault);

  Volts volts() const;
  std::size_t changes() const;

 private:
  void plug();
  void unplug();
  void run();
  void serve(std::unique_lock<std::mutex>& lock);
  void read();
  std::string attribute(Signal signal, const std::string& suffix) const;

  const IioSettings settings_;
  const std::filesystem::path root_;
  const std::filesystem::path folder_;
  Outputs outputs_;
  mutable std::mutex mutex_;
  virtual_urg::Wake wake_;
  Descriptor watch_;    // none while it is unplugged
  double back_at_ = 0;  // [s] steady; 0: it is plugged in
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace kurumaisu::dac
