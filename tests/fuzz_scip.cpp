// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer's target for what reads a sensor's bytes: Assembler, decodeScan, parameters. The first byte of an input
// says into what pieces the others are cut.
#include <string>
#include <vector>

#include "fuzzing.h"
#include "scip/code.h"
#include "scip/message.h"
#include "scip/sensor.h"

namespace s = kurumaisu::scip;
using fuzzing::require;

namespace {

constexpr std::uint32_t kWhole = 0;

/// All messages, the bytes given in pieces of at most so many; a piece's time is the number of its first byte.
std::vector<s::Message> messagesOf(const std::string& bytes, std::uint32_t longest_piece,
                                   s::Assembler& assembler) {
  std::vector<s::Message> messages;
  fuzzing::Dice dice(longest_piece);
  assembler.expect("PP");
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t wanted = longest_piece == kWhole ? bytes.size() : 1 + dice.roll(longest_piece);
    const std::size_t size = std::min(bytes.size() - at, wanted);
    assembler.add(std::string_view(bytes).substr(at, size), static_cast<double>(at));
    while (auto message = assembler.next()) messages.push_back(*message);
    at += size;
  }
  return messages;
}

void requireSame(const std::vector<s::Message>& a, const std::vector<s::Message>& b) {
  require(a.size() == b.size(), "pieces change the number of messages");
  for (std::size_t k = 0; k < a.size(); ++k) {
    require(a[k].command == b[k].command && a[k].status == b[k].status && a[k].lines == b[k].lines &&
                a[k].bad_sums == b[k].bad_sums,
            "pieces change a message");
    require(a[k].first_byte <= b[k].first_byte, "a piece came before the whole");
  }
}

void requireSane(const s::Parameters& p) {
  require(p.first >= 0 && p.first <= p.last && p.last <= 9999, "steps");
  require(p.steps_per_turn > 0 && p.last - p.first < p.steps_per_turn, "more than a turn");
  require(p.distance_min >= 0 && p.distance_min < p.distance_max, "distances");
  require(p.front >= 0 && p.rpm > 0 && p.stepTime() > 0, "front or speed");
}

void read(const s::Message& message, fuzzing::Oracle& oracle) {
  require(message.status.size() == 1 || message.status.size() == 2, "a status that is none");
  if (const auto request = s::request(message.command.substr(0, message.command.find(';')))) {
    try {
      oracle.check(message.command, s::decodeScan(message, *request));
    } catch (const s::BadFrame&) {
    }
  }
  try {
    requireSane(s::parameters(message));
  } catch (const s::BadFrame&) {
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  s::Assembler whole;
  s::Assembler in_pieces;
  const std::vector<s::Message> messages = messagesOf(bytes, kWhole, whole);
  requireSame(messages, messagesOf(bytes, 1U + data[0], in_pieces));
  require(whole.counts().messages == messages.size(), "a message is not counted");
  require(whole.counts().stray_bytes == in_pieces.counts().stray_bytes, "pieces change the stray bytes");
  require(whole.counts().unreadable == in_pieces.counts().unreadable, "pieces change the unreadable");
  fuzzing::Oracle oracle(bytes);
  for (const s::Message& message : messages) read(message, oracle);
  return 0;
}

std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  return fuzzing::mutateWithSums(data, size, most, seed);
}
