// SPDX-License-Identifier: BSD-3-Clause
// A converter from a device's file: open(readDevice("serial_ascii.yaml")).
#pragma once

#include <memory>

#include "dac/converter.h"
#include "dac/settings.h"

namespace kurumaisu::dac {

/// Opens a device for this program alone; prepare() comes next. No voltage is written before the first put().
///
/// Throws Fault; std::invalid_argument for a device that is not what its file says.
std::unique_ptr<Converter> open(const Device& device);

/// The same, and waits until it takes voltages.
std::unique_ptr<Converter> openAndPrepare(const Device& device);

}  // namespace kurumaisu::dac
