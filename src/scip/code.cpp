// SPDX-License-Identifier: BSD-3-Clause
#include "scip/code.h"

namespace kurumaisu::scip {
namespace {

constexpr unsigned kZero = 0x30;  // the character of 0
constexpr unsigned kBits = 6;     // of a character
constexpr unsigned kMask = (1U << kBits) - 1;

}  // namespace

char sum(std::string_view line) {
  unsigned total = 0;
  for (const char c : line) total += static_cast<unsigned char>(c);
  return static_cast<char>((total & kMask) + kZero);
}

std::string encode(std::uint32_t value, std::size_t characters) {
  if (characters * kBits < 32 && value >> (characters * kBits) != 0) {
    throw std::out_of_range(std::to_string(value) + " does not fit into " + std::to_string(characters) +
                            " characters of 6 bits");
  }
  std::string text(characters, '0');
  for (auto place = text.rbegin(); place != text.rend(); ++place, value >>= kBits) {
    *place = static_cast<char>((value & kMask) + kZero);
  }
  return text;
}

std::uint32_t decode(std::string_view characters) {
  std::uint32_t value = 0;
  for (const char c : characters) {
    const unsigned digit = static_cast<unsigned char>(c) - kZero;
    if (digit > kMask)
      throw BadFrame("byte " + std::to_string(int{static_cast<unsigned char>(c)}) + " in a number");
    value = value << kBits | digit;
  }
  return value;
}

}  // namespace kurumaisu::scip
