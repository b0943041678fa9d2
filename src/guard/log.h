// SPDX-License-Identifier: BSD-3-Clause
// Lines on stderr with a stable code that one can grep.
#pragma once

#include <string>

namespace kurumaisu::guard {

/// Writes "CODE: text". A reader that does not read loses the line: the guard must not wait for it.
void say(const std::string& code, const std::string& text);

/// "; noticed at 1234.567890 s, neutral 0.812 ms later", both of the steady clock.
std::string reaction(double noticed, double neutral);

}  // namespace kurumaisu::guard
