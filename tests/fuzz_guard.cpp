// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer's target for what decides about the chair's motion: decode and Guard. An input is a story of messages,
// good, spoilt and arbitrary, of pauses, leaving clients and failing devices.
#include <array>
#include <cstring>
#include <string>

#include "fuzzing.h"
#include "guarding.h"

namespace g = kurumaisu::guard;
using fuzzing::require;

namespace {

constexpr double kStart = 1000;        // [s]
constexpr double kPeriod = 0.02;       // [s]
constexpr double kMillisecond = 1e-3;  // [s]
constexpr double kVoltsPerStep = 2.5 / 32768;

/// The input, read bytewise; zeros follow its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  bool empty() const { return at_ >= size_; }

  template <typename T>
  T take() {
    T value{};
    const std::size_t count = std::min(sizeof value, size_ - at_);
    std::memcpy(&value, data_ + at_, count);
    at_ += count;
    return value;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

class Story {
 public:
  Story() { guard_.connect(); }

  void step(Input& input) {
    switch (input.take<std::uint8_t>() % 8) {
      case 0:
        return hold(input.take<std::uint8_t>() % 64);
      case 1:
        return good(input);
      case 2:
        return arbitrary(input);
      case 3:
        return spoilt(input);
      case 4:
        return pass(kMillisecond * input.take<std::uint8_t>());
      case 5:
        return change();
      case 6:
        return device(input.take<std::uint8_t>());
      default:
        return garbage(input);
    }
  }

 private:
  void check() {
    const char* fault = watch_.fault(guard_, now_);
    require(fault == nullptr, fault);
  }

  void pass(double seconds) {
    now_ += seconds;
    guard_.advance(now_);
    check();
  }

  void give(const g::Request& message) {
    watch_.message(message, now_);
    guard_.receive(message, now_);
    check();
  }

  void hold(int count) {
    for (int i = 0; i < count; ++i) {
      pass(kPeriod);
      give(guarding::request(++sequence_, now_));
    }
  }

  g::Request next(Input& input) {
    pass(kMillisecond * (input.take<std::uint8_t>() % 64));
    const double translation = kVoltsPerStep * input.take<std::int16_t>();
    return guarding::request(++sequence_, now_, translation, kVoltsPerStep * input.take<std::int16_t>());
  }

  void good(Input& input) { give(next(input)); }

  /// One of the message's eight-byte words is another.
  void spoilt(Input& input) {
    g::Request message = next(input);
    const std::size_t word = input.take<std::uint8_t>() % (sizeof message / 8);
    const auto other = input.take<std::uint64_t>();
    std::memcpy(reinterpret_cast<char*>(&message) + 8 * word, &other, sizeof other);
    // a stamp that is only a little wrong would not come by chance
    if (word == 2 && other % 2 == 0) {
      const std::int64_t off = static_cast<std::int16_t>(other >> 8U);  // [ms]
      message.time = guarding::nanoseconds(now_) + 1'000'000 * off;
    }
    bytes(&message, sizeof message);
  }

  void arbitrary(Input& input) {
    const auto message = input.take<std::array<char, sizeof(g::Request)>>();
    bytes(message.data(), message.size());
  }

  void garbage(Input& input) {
    const auto bytes_of_it = input.take<std::array<char, sizeof(g::Request) + 1>>();
    bytes(bytes_of_it.data(), input.take<std::uint8_t>() % (bytes_of_it.size() + 1));
  }

  /// As the server does it.
  void bytes(const void* data, std::size_t size) {
    if (const auto message = g::decode<g::Request>(data, size)) {
      require(size == sizeof(g::Request) && std::memcmp(data, "DRGK", 4) == 0, "a message that is none");
      return give(*message);
    }
    watch_.broken();
    guard_.receiveGarbage();
    check();
  }

  void change() {
    guard_.disconnect();
    watch_.broken();
    check();
    guard_.connect();
    sequence_ = 0;
  }

  void device(std::uint8_t what) {
    if (what % 2 == 0) {
      guard_.loseDevice();
    } else {
      guard_.findDevice();
    }
    watch_.device(what % 2 == 0);
    check();
  }

  g::Guard guard_{guarding::limits()};
  guarding::Watch watch_{guarding::limits()};
  double now_ = kStart;
  std::uint64_t sequence_ = 0;
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  Story story;
  while (!input.empty()) story.step(input);
  return 0;
}
