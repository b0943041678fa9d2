// SPDX-License-Identifier: BSD-3-Clause
#include "dac/open.h"

#include "dac/iio_converter.h"
#include "dac/serial_converter.h"

namespace kurumaisu::dac {

std::unique_ptr<Converter> open(const Device& device) {
  if (const auto* serial = std::get_if<SerialSettings>(&device.back_end)) {
    return std::make_unique<SerialConverter>(device.channels, *serial);
  }
  return std::make_unique<IioConverter>(device);
}

std::unique_ptr<Converter> openAndPrepare(const Device& device) {
  std::unique_ptr<Converter> converter = open(device);
  while (!converter->prepare()) continue;
  return converter;
}

}  // namespace kurumaisu::dac
