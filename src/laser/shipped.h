// SPDX-License-Identifier: BSD-3-Clause
// A YAML of this package as the parameter server would hold it.
#pragma once

#include <string>

#include "params.h"

namespace kurumaisu::laser {

/// The scalars of a YAML mapping: true and false, integers, numbers, and strings for the rest. A number in
/// quotes is a number. Throws std::invalid_argument naming the file for one that is missing or is no flat
/// mapping.
XmlRpc::XmlRpcValue loadShipped(const std::string& path);

}  // namespace kurumaisu::laser
