// SPDX-License-Identifier: BSD-3-Clause
#include "guard/protocol.h"

#include <array>
#include <cstring>

namespace kurumaisu::guard {
namespace {

constexpr std::array kStates = {"idle", "holding neutral before arming", "armed", "tripped"};
constexpr std::array kReasons = {"none",
                                 "another client is connected",
                                 "the client is gone",
                                 "the client is silent",
                                 "not a message",
                                 "another version",
                                 "sequence not rising",
                                 "too old",
                                 "from the future",
                                 "not finite",
                                 "outside the band",
                                 "another reference",
                                 "step too large",
                                 "not neutral before arming",
                                 "stopped by the client",
                                 "the D/A converter failed",
                                 "the sentinel is silent",
                                 "the computer slept"};

}  // namespace

template <typename Message>
std::optional<Message> decode(const void* bytes, std::size_t size) {
  Message message;
  if (size != sizeof message) return std::nullopt;
  std::memcpy(&message, bytes, sizeof message);
  return message.magic == kMagic ? std::optional(message) : std::nullopt;
}

template std::optional<Request> decode<Request>(const void* bytes, std::size_t size);
template std::optional<Reply> decode<Reply>(const void* bytes, std::size_t size);

std::string nameOf(State state) { return kStates.at(static_cast<std::size_t>(state)); }
std::string nameOf(Reason reason) { return kReasons.at(static_cast<std::size_t>(reason)); }

std::optional<State> stateOf(std::uint16_t number) {
  return number < kStates.size() ? std::optional(static_cast<State>(number)) : std::nullopt;
}

std::optional<Reason> reasonOf(std::uint16_t number) {
  return number < kReasons.size() ? std::optional(static_cast<Reason>(number)) : std::nullopt;
}

}  // namespace kurumaisu::guard
