// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

namespace kurumaisu {

/// Adds the localiser to kurumaisu._slam.
void bindLocalizer(pybind11::module_& m);

}  // namespace kurumaisu
