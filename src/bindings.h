// SPDX-License-Identifier: BSD-3-Clause
// What the parts of the module kurumaisu._core share.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

namespace kurumaisu {

using Array = pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;

void bindBase(pybind11::module_& m);
void bindFollow(pybind11::module_& m);
void bindPlausible(pybind11::module_& m);
void bindRaycast(pybind11::module_& m);
void bindArena(pybind11::module_& m);
void bindCellRays(pybind11::module_& m);
void bindCells(pybind11::module_& m);
void bindCamera(pybind11::module_& m);
void bindVirtualUrg(pybind11::module_& m);
void bindWire(pybind11::module_& m);

}  // namespace kurumaisu
