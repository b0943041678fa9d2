// SPDX-License-Identifier: BSD-3-Clause
// Lines on stderr with a stable code that one can grep. Who writes them never waits for who reads them.
#pragma once

#include <string>

#include "file_descriptor.h"

namespace kurumaisu::guard {

/// As long as there is one, stderr is a pipe to a process that copies it to where stderr was: a terminal that nobody
/// reads, or a disk that hangs, keeps that process waiting and nobody else. It takes no signals, and ends with the
/// last that writes.
class LogWriter {
 public:
  /// Throws std::system_error.
  LogWriter();
  /// Waits for the last lines, but not long.
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

 private:
  Descriptor done_;  ///< hangs up when all is written
};

/// Writes "CODE: text". A line for which the pipe has no room is dropped and counted; GUARD_LOG_DROPPED says how many
/// were, once there is room again.
void say(const std::string& code, const std::string& text);

/// "; noticed at 1234.567890 s, neutral 0.812 ms later", both of the steady clock.
std::string reaction(double noticed, double neutral);

}  // namespace kurumaisu::guard
