// SPDX-License-Identifier: BSD-3-Clause
// What may go wrong with a virtual board.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "dac/channel.h"

namespace kurumaisu::dac {

struct BoardFault {
  enum What {
    kSilent,  ///< obeys, but does not answer
    kDeaf,    ///< neither obeys nor answers
    kWrong,   ///< obeys, but answers "?"
    kCut,     ///< obeys; of its answer comes half, without an end
    kLate,    ///< obeys at once, answers after `value` [s]
    kStall,   ///< reads nothing for `value` [s]
    kLost,    ///< puts out its lowest code, whatever is asked for, and says so
    kUnplug,  ///< before the command is read: out of its socket, back after `value` [s] under a new terminal
  } what;
  std::uint64_t at;              ///< the first command that meets it; 1 is the first of all
  std::uint64_t count;           ///< how many commands meet it
  double value;                  ///< [s]
  std::optional<Signal> signal;  ///< it spares commands that do not write this
};

/// NAME[/SIGNAL][@AT][xCOUNT][=SECONDS]: late@5x3=0.1, wrong/reference; without AT it begins with the command after
/// `heard`.
///
/// Throws std::invalid_argument.
BoardFault boardFault(const std::string& text, std::uint64_t heard);

/// Names and what they do, one per line.
std::string boardFaults();

}  // namespace kurumaisu::dac
