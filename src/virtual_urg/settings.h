// SPDX-License-Identifier: BSD-3-Clause
// The commands that set something: BM QT RS TM SS CR HS DB.
#pragma once

#include <string>
#include <string_view>

#include "virtual_urg/commands.h"

namespace kurumaisu::virtual_urg {

/// Does it hold digits only, at least one?
bool isNumber(std::string_view text);

/// [1/min] of the mirror, as CR has it.
int motorSpeed(const scip::Parameters& parameters, const Memory& memory);

/// RS: as after power-up, but in the same protocol.
Memory afterReset(const Memory& memory, const Model& model);

/// Obeys a command of the right length that measures nothing; its status.
std::string setting(std::string_view name, std::string_view argument, const Model& model, Memory& memory);

}  // namespace kurumaisu::virtual_urg
