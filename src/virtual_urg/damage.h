// SPDX-License-Identifier: BSD-3-Clause
// What faults do to a scan on its way out.
#pragma once

#include <string>

#include "virtual_urg/faults.h"
#include "virtual_urg/frames.h"

namespace kurumaisu::virtual_urg {

/// What is measured at a scan, counted from 1: zeros, codes.
Steps mismeasured(Steps steps, const Faults& faults, int scan);

/// The bytes of a scan: corrupt, badlf, trunc, noend, garbage, dup.
std::string damaged(std::string frame, const Faults& faults, int scan);

/// Status that a scan has in place of data, by the faults errNN; empty: none.
std::string statusAt(const Faults& faults, int scan);

}  // namespace kurumaisu::virtual_urg
