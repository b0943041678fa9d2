// SPDX-License-Identifier: BSD-3-Clause
// What libFuzzer's targets share: an oracle that stops the program, pieces of bytes, and a mutator that knows sums.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "scip/request.h"
#include "scip/scan.h"
#include "scip_frames.h"

extern "C" {
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);
std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed);
}

namespace fuzzing {

inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "FUZZ: %s\n", what);
  std::abort();
}

/// Small numbers from a seed, the same on every machine.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : state_(seed) {}

  /// From 0 to n - 1.
  std::uint32_t roll(std::uint32_t n) {
    state_ = 1664525U * state_ + 1013904223U;
    return (state_ >> 8U) % n;
  }

 private:
  std::uint32_t state_;
};

/// Scans that were decoded, against the bytes from which they were: each must stand there, byte for byte, as the
/// specification writes it, in order and without overlap. Written without src/scip.
class Oracle {
 public:
  explicit Oracle(std::string bytes) : bytes_(std::move(bytes)) {}

  /// More bytes that were sent; those of long ago are forgotten.
  void add(const std::string& bytes) {
    if (bytes_.size() > kRemembered) {
      bytes_.erase(0, bytes_.size() - kRemembered / 2);
      from_ = 0;
    }
    bytes_ += bytes;
  }

  /// A scan in a reply of this echo.
  void check(const std::string& echo, const kurumaisu::scip::Rotation& rotation) {
    const std::string frame = frameOf(echo, rotation);
    const std::size_t at = bytes_.find(frame, from_);
    require(at != std::string::npos, "a scan that was not sent");
    require(frames::read(bytes_.substr(at, frame.size()), echo, numbersOf(rotation).size()).has_value(),
            "the oracle does not agree with itself");
    from_ = at + frame.size();
  }

  /// A scan that answers a stream's command; its echo may count down and carry a string.
  void checkAnswer(const std::string& command, const kurumaisu::scip::Rotation& rotation) {
    const std::string frame = frameOf(command, rotation).substr(command.size());
    const std::string asked = command.substr(0, 13);
    for (std::size_t at = bytes_.find(frame, from_); at != std::string::npos;
         at = bytes_.find(frame, at + 1)) {
      const std::size_t start = bytes_.rfind('\n', at - 1) + 1;
      if (at == 0 || bytes_.substr(start, at - start).find(asked) == std::string::npos) continue;
      from_ = at + frame.size();
      return;
    }
    require(false, "a scan that was not sent");
  }

 private:
  static constexpr std::size_t kRemembered = 1U << 18U;  // [bytes] some times what the driver keeps

  static std::vector<std::uint32_t> numbersOf(const kurumaisu::scip::Rotation& rotation) {
    std::vector<std::uint32_t> numbers;
    for (std::size_t k = 0; k < rotation.distances.size(); ++k) {
      numbers.push_back(static_cast<std::uint32_t>(rotation.distances[k]));
      if (!rotation.intensities.empty())
        numbers.push_back(static_cast<std::uint32_t>(rotation.intensities.at(k)));
    }
    return numbers;
  }

  static std::string frameOf(const std::string& echo, const kurumaisu::scip::Rotation& rotation) {
    return frames::scan(echo, {rotation.clock, numbersOf(rotation)});
  }

  std::string bytes_;
  std::size_t from_ = 0;
};

/// Mutates, and half the time makes each line's sum right: by chance it would be once in 64, and a frame's never.
inline std::size_t mutateWithSums(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  Dice dice(seed);
  size = LLVMFuzzerMutate(data, size, most);
  if (dice.roll(2) == 0) return size;
  unsigned sum = 0;
  std::size_t length = 0;
  for (std::size_t at = 0; at < size; ++at) {
    if (data[at] != '\n') {
      sum += data[at];
      ++length;
      continue;
    }
    const bool is_first = at < length + 2 || data[at - length - 2] == '\n';  // a reply's, an echo
    if (length > 1 && !is_first) data[at - 1] = static_cast<std::uint8_t>('0' + (sum - data[at - 1]) % 64);
    sum = 0;
    length = 0;
  }
  return size;
}

}  // namespace fuzzing
