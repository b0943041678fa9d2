// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace pybind11 {
class module_;
}

namespace kurumaisu {

/// Adds Clearance to the module.
void bindContact(pybind11::module_& m);

}  // namespace kurumaisu
