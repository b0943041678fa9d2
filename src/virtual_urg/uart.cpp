// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/uart.h"

#include <cstddef>

namespace kurumaisu::virtual_urg {
namespace {

constexpr std::size_t kFrame = 10;  // bits of a byte on the line: start, 8 data, stop
constexpr int kDataBits = 8;

/// The line's level over time, in bits of the sender; it rests at 1.
class Line {
 public:
  explicit Line(std::string_view bytes) : bytes_(bytes) {}

  std::size_t end() const { return bytes_.size() * kFrame; }

  bool level(std::size_t bit) const {
    if (bit >= end()) return true;
    const std::size_t place = bit % kFrame;
    if (place == 0) return false;
    if (place == kFrame - 1) return true;
    return ((static_cast<unsigned char>(bytes_[bit / kFrame]) >> (place - 1)) & 1U) != 0;
  }

  bool at(double time) const { return level(static_cast<std::size_t>(time)); }

  /// Where the level next falls, from a bit on; end() if it does not.
  std::size_t fall(std::size_t bit) const {
    for (; bit < end(); ++bit) {
      if (!level(bit) && (bit == 0 || level(bit - 1))) return bit;
    }
    return end();
  }

 private:
  std::string_view bytes_;
};

}  // namespace

std::string received(std::string_view bytes, int sent_rate, int read_rate) {
  if (sent_rate == read_rate) return std::string(bytes);
  const double width = static_cast<double>(sent_rate) / read_rate;  // of a read bit, in sent ones
  const Line line(bytes);
  std::string result;
  std::size_t start = line.fall(0);
  while (start < line.end()) {
    const auto sample = [&](double bit) { return line.at(static_cast<double>(start) + (bit + 0.5) * width); };
    unsigned value = 0;
    for (int bit = 0; bit < kDataBits; ++bit) {
      if (sample(1 + bit)) value |= 1U << static_cast<unsigned>(bit);
    }
    const bool whole = sample(kFrame - 1);
    result.push_back(whole ? static_cast<char>(value) : '\0');
    start = line.fall(static_cast<std::size_t>(static_cast<double>(start) + (kFrame - 0.5) * width) + 1);
  }
  return result;
}

}  // namespace kurumaisu::virtual_urg
