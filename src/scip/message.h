// SPDX-License-Identifier: BSD-3-Clause
// Bytes from a sensor into replies; what is not one is dropped and counted.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kurumaisu::scip {

/// A reply: what stands between empty lines.
struct Message {
  std::string command;             ///< the echo
  std::string status;              ///< two characters; in SCIP 1.1 one
  std::vector<std::string> lines;  ///< without their sums
  int bad_sums = 0;                ///< of the lines
  double first_byte = 0;           ///< [s] host's time at which the echo began to come
};

/// Cuts a stream of bytes into messages, whatever stands between them. The messages depend on the bytes alone, not on
/// the pieces in which they come; time is linear in their number, memory bounded if next() is called until it has none.
class Assembler {
 public:
  struct Counts {
    std::uint64_t messages = 0;
    std::uint64_t bad_sums = 0;     ///< lines whose sum is wrong
    std::uint64_t unreadable = 0;   ///< replies without a readable echo and status, dropped
    std::uint64_t cut = 0;          ///< replies that ran into the next one, dropped
    std::uint64_t stray_bytes = 0;  ///< before an echo, dropped
  };

  /// From now on this command's echo is known, too, where noise stands before it. Echoes of measurements always are.
  void expect(std::string_view command) { expected_ = command; }

  /// Takes bytes that came at a time [s].
  void add(std::string_view bytes, double time);

  /// The oldest whole message not yet taken.
  std::optional<Message> next();

  /// Forgets what came so far.
  void clear();

  const Counts& counts() const { return counts_; }

 private:
  std::optional<Message> parse(std::string_view block);
  double timeOf(std::size_t position) const;
  void drop(std::size_t bytes);

  std::string expected_;
  std::string buffer_;
  std::uint64_t dropped_ = 0;                              // bytes that came before the buffer's
  std::size_t taken_ = 0;                                  // the buffer's, already done with
  std::size_t searched_ = 0;                               // bytes after them in which no end has been found
  std::deque<std::pair<std::uint64_t, double>> arrivals_;  // from a byte of the stream on, time [s]
  Counts counts_;
};

}  // namespace kurumaisu::scip
