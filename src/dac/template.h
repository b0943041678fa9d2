// SPDX-License-Identifier: BSD-3-Clause
// Frames from templates: "W{ch}{code:04X}", as Python's format() fills them in.
#pragma once

#include <array>
#include <string>
#include <variant>
#include <vector>

#include "dac/channel.h"

namespace kurumaisu::dac {

/// One channel, as a template can name it.
struct Filling {
  std::string ch;  ///< the board's name for it
  Level level;
};

using Fillings = std::array<Filling, kSignals>;

/// Text with placeholders. In a frame for one channel {ch}, {code}, {volt}; in one for all of them {reference.code},
/// {translation.volt:+.3f}, ...
///
/// {code:SPEC}: SPEC is d, x or X after an optional width, with a 0 before it if it is filled up by zeros: 04X.
/// {volt:SPEC}: [V] at the pin; SPEC is [+][0][width].digits f: 06.3f. {{ and }} are braces.
class Template {
 public:
  struct Field {
    enum What { kCh, kCode, kVolt } what;
    int signal;  ///< a Signal, or kThis
    bool plus;
    bool zeros;
    int width;   ///< 0: as long as it is
    int digits;  ///< after the point
    char form;   ///< d x X f; s for ch
  };
  using Part = std::variant<std::string, Field>;
  static constexpr int kThis = -1;  // the channel that the frame is for

  /// Throws std::invalid_argument naming what is wrong with the text. Without placeholders: plain text, such as an
  /// identification, in which only {{ and }} are allowed.
  enum class Kind { kPlain, kChannel, kAll };
  Template() = default;
  Template(const std::string& text, Kind kind);

  /// The frame for one channel.
  std::string fill(const Filling& filling) const;

  /// The frame for all channels.
  std::string fill(const Fillings& fillings) const;

  /// What a plain template says.
  std::string plain() const;

  const std::vector<Part>& parts() const { return parts_; }

  /// Does it say the code or the voltage of this signal (or of kThis)?
  bool tells(int signal) const;
  bool names() const;  ///< {ch}

  /// Throws std::invalid_argument for a code field of fixed width that is too narrow for a code.
  void checkWidth(int signal, const Coding& coding) const;

 private:
  std::vector<Part> parts_;
};

}  // namespace kurumaisu::dac
