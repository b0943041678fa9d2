// SPDX-License-Identifier: BSD-3-Clause
// Commands to a board and its replies, of which none is ever taken for another's.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "serial/port.h"

namespace kurumaisu::dac {

struct Manner {
  std::string terminator;  ///< of commands
  std::string reply_terminator;
  double reply_timeout;  ///< [s]
  double late_reply;     ///< [s] after which a reply that has not come never will
  int retries;
};

/// A missing or wrong reply may still come, for so long as late_reply says: it is owed. Whether a reply like it answers
/// a new command or the old one cannot be told, so before a command is asked that could be mixed up so, settle() waits.
class Dialogue {
 public:
  Dialogue(std::unique_ptr<serial::Port> port, Manner manner);

  /// Sends a command and waits for the reply that a shell pattern describes; again, as often as retries says.
  ///
  /// Returns the reply. Throws Fault if it does not come, serial::LinkLost if nothing can.
  std::string ask(const std::string& command, const std::string& expect);

  /// Sends a command without waiting; its reply, if a pattern describes one, is owed.
  void tell(const std::string& command, const std::string& expect);

  struct Command {
    std::string text;
    std::string expect;  // "": it has no reply
  };

  /// Sends commands without waiting in between, then waits for their replies. Returns whether all have come, and nothing
  /// else; those that have not are owed. Sends nothing if a reply is owed already.
  bool askAtOnce(const std::vector<Command>& commands);

  /// Could the reply to an earlier command be taken for one that is expected now?
  bool inDoubt(const std::string& expect) const;

  /// Waits until all owed replies have come or are too late to come.
  void settle();

 private:
  struct Owed {
    std::string expect;
    double until;  // [s] steady
  };

  std::optional<std::string> next(double until);
  bool settled(const std::string& line);
  void discard();
  void send(const std::string& command);
  void owe(const std::string& expect, double sent);

  std::unique_ptr<serial::Port> port_;
  Manner manner_;
  std::string input_;
  std::vector<Owed> owed_;
};

/// Text with its control characters readable: "OK\r".
std::string readable(const std::string& text);

}  // namespace kurumaisu::dac
