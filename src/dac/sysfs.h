// SPDX-License-Identifier: BSD-3-Clause
// The folder of a device in sysfs, and its attributes: small files of text.
#pragma once

#include <optional>
#include <string>

#include "file_descriptor.h"

namespace kurumaisu::dac {

/// Held open: once the device is gone all access fails, even if another has come to the same name.
class Attributes {
 public:
  /// For this program alone. Throws Fault.
  explicit Attributes(const std::string& folder);

  /// An attribute's text without the end of its line. Throws Fault.
  std::string read(const std::string& name) const;

  /// The same; nothing where there is no such attribute.
  std::optional<std::string> readIfThere(const std::string& name) const;

  /// Throws Fault, also if not all of it was taken.
  void write(const std::string& name, const std::string& text) const;

  const std::string& folder() const { return folder_; }

 private:
  std::string folder_;
  Descriptor directory_;
};

}  // namespace kurumaisu::dac
