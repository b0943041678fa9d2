// SPDX-License-Identifier: BSD-3-Clause
// Values that nobody knows but the owner of the board.
#pragma once

#include "yaml.h"

namespace kurumaisu::dac {

/// What such a value begins with; after it comes what is to be looked up, and where.
constexpr const char* kUnfilled = "FILL IN";

/// Throws std::invalid_argument that lists all such values with their lines, if there is any.
void refuseUnfilled(const YamlValue& tree);

}  // namespace kurumaisu::dac
