// SPDX-License-Identifier: BSD-3-Clause
// A D/A chip that Linux's IIO has a driver for: MCP4728, AD5592R, ...
#pragma once

#include <optional>
#include <string>

#include "dac/converter.h"
#include "dac/settings.h"
#include "dac/sysfs.h"

namespace kurumaisu::dac {

/// Scale and offset are the kernel's: volt = (raw + out_voltageY_offset) * out_voltageY_scale / 1000.
class IioConverter : public Converter {
 public:
  /// Opens the device for this program alone; writes nothing. Throws Fault; std::invalid_argument, naming the file, where
  /// the chip's range does not hold what the clamp allows.
  explicit IioConverter(const Device& device);

  Volts put(const Volts& volts) override;
  void reopen() override;
  std::string name() const override;

 private:
  void open();
  std::string attribute(Signal signal, const std::string& suffix) const;
  double number(Signal signal, const std::string& suffix, std::optional<double> otherwise) const;
  void write(Signal signal, int code) const;

  std::string file_;
  Channels channels_;
  IioSettings settings_;
  Codings codings_{};
  std::optional<Attributes> attributes_;
  bool powered_ = false;  // by us, since it was opened
};

}  // namespace kurumaisu::dac
