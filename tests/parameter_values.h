// SPDX-License-Identifier: BSD-3-Clause
// Values as of a parameter server, made here: no master is asked.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>

#include "params.h"

namespace parameters {

using Value = XmlRpc::XmlRpcValue;

/// The message that the action throws; empty if it throws none.
inline std::string complaint(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

}  // namespace parameters
