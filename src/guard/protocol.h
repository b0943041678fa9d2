// SPDX-License-Identifier: BSD-3-Clause
// What client and guard say to each other: one fixed message each way over a local SOCK_SEQPACKET socket.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>

#include "dac/converter.h"

namespace kurumaisu::guard {

constexpr std::uint32_t kMagic = 0x4b475244;  // "KGRD"
constexpr std::uint16_t kVersion = 1;

enum class Kind : std::uint16_t {
  kPut = 1,   ///< these voltages
  kStop = 2,  ///< neutral at once, and arm anew; the voltages are not looked at
};

/// What a client sends. Both ends are on one machine: its byte order, its CLOCK_MONOTONIC.
struct Request {
  std::uint32_t magic;
  std::uint16_t version;
  std::uint16_t kind;  ///< Kind
  std::uint64_t sequence;
  std::int64_t time;   ///< CLOCK_MONOTONIC when it was made [ns]
  double translation;  ///< [V]
  double steering;     ///< [V]
  double reference;    ///< [V]
};
static_assert(sizeof(Request) == 48 && std::is_trivially_copyable_v<Request>,
              "no padding: all of it is sent");

enum class State : std::uint16_t {
  kIdle = 0,     ///< neutral; no client asked for anything yet
  kHolding = 1,  ///< neutral; the client is holding neutral, which arms
  kArmed = 2,    ///< what the client asks for is put out
  kTripped = 3,  ///< neutral until the client has held neutral again
};

/// Why the guard is not armed.
enum class Reason : std::uint16_t {
  kNone = 0,
  kBusy,        ///< another client is there
  kClientGone,  ///< it closed the connection, or died
  kSilent,      ///< no valid message for too long
  kGarbage,     ///< not a message, or one of an unknown kind
  kVersion,     ///< of another version
  kSequence,    ///< number not above the last one's
  kOld,         ///< made too long ago, or before the last one
  kFuture,      ///< made later than now
  kNotFinite,
  kBand,        ///< a voltage outside its band
  kReference,   ///< not the reference that is put out
  kStep,        ///< too far from the last voltage, for the time that has passed
  kNotNeutral,  ///< motion asked for before arming
  kStopped,     ///< the client asked for it
  kDevice,      ///< the D/A converter failed
  kUnwatched,   ///< no sentinel watches over the guard
  kSlept,       ///< this computer was suspended
};

/// What the guard answers to each message, and to a client that it refuses.
struct Reply {
  std::uint32_t magic;
  std::uint16_t version;
  std::uint16_t state;     ///< State
  std::uint16_t reason;    ///< Reason
  std::uint16_t device;    ///< 1: the voltages are known; 0: the device is lost, they are the last known ones
  std::uint32_t trips;     ///< since the guard's start
  std::uint64_t sequence;  ///< the last message that went into it
  std::int64_t time;       ///< CLOCK_MONOTONIC of the output [ns]
  double translation;      ///< [V] what the device holds
  double steering;         ///< [V]
  double reference;        ///< [V]
};
static_assert(sizeof(Reply) == 56 && std::is_trivially_copyable_v<Reply>, "no padding: all of it is sent");

/// A message's bytes as a message: none if the size or the magic is wrong. The version is for the reader to judge.
template <typename Message>
std::optional<Message> decode(const void* bytes, std::size_t size);

std::string nameOf(State state);
std::string nameOf(Reason reason);

/// The enumerator of a number that came over the wire; none if it is no such number.
std::optional<State> stateOf(std::uint16_t number);
std::optional<Reason> reasonOf(std::uint16_t number);

}  // namespace kurumaisu::guard
