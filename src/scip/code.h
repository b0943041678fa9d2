// SPDX-License-Identifier: BSD-3-Clause
// Numbers and sums in the sensor's alphabet (SCIP 2.0, Hokuyo C-42-03320B).
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace kurumaisu::scip {

/// Bytes that are not what the protocol has there.
struct BadFrame : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The check character of a line: the low six bits of its bytes' sum, + 0x30.
char sum(std::string_view line);

/// A number in so many characters of six bits, + 0x30, most significant first. Throws std::out_of_range.
std::string encode(std::uint32_t value, std::size_t characters);

/// The number in up to five characters. Throws BadFrame for one that is none of the alphabet, 0x30 to 0x6f.
std::uint32_t decode(std::string_view characters);

}  // namespace kurumaisu::scip
