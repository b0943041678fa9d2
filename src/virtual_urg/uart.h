// SPDX-License-Identifier: BSD-3-Clause
// What comes out of a serial line whose two ends do not run at the same rate.
#pragma once

#include <string>
#include <string_view>

namespace kurumaisu::virtual_urg {

/// Bytes sent 8N1 at one rate [baud], as a receiver at another reads them. One whose stop bit is missing reads as 0,
/// as Linux hands it on; the same rate changes nothing. Both rates must be above 0.
std::string received(std::string_view bytes, int sent_rate, int read_rate);

}  // namespace kurumaisu::virtual_urg
