// SPDX-License-Identifier: BSD-3-Clause
// The part of the module kurumaisu._core that follows.
#pragma once

#include <pybind11/pybind11.h>

namespace kurumaisu {

void bindFollow(pybind11::module_& m);

}  // namespace kurumaisu
