// SPDX-License-Identifier: BSD-3-Clause
// What a board makes of lines that come: templates backwards.
#pragma once

#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "dac/settings.h"

namespace kurumaisu::dac {

/// Understands what a SerialSettings says, and answers as it expects.
class BoardReader {
 public:
  /// Throws std::invalid_argument where no reply can be made up for `expect`.
  explicit BoardReader(const SerialSettings& settings);

  struct Heard {
    std::string reply;                          ///< without its end; none if the board does not answer
    std::vector<std::pair<Signal, int>> codes;  ///< what it is to put out
  };

  /// Nothing for a line that it does not understand. lost: of a board whose outputs are at their lowest codes.
  std::optional<Heard> hear(const std::string& line, bool lost) const;

 private:
  std::optional<Heard> hearWrite(const std::string& line, bool lost) const;

  SerialSettings settings_;
  std::regex form_;  // of the line that writes
};

}  // namespace kurumaisu::dac
