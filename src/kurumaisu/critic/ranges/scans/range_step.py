# SPDX-License-Identifier: BSD-3-Clause
"""The steps in which readings come: where a laser rounds to a coarse grid, its messages may round once more."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray

_MILLIMETRE = 1e-3  # [m] to which a message rounds
_COARSE = 2.5  # millimetres from which a grid is not that of the message
_ADJACENT = 1.5  # usual steps up to which two values are neighbours
_ROUNDED = 0.65  # millimetres that values may be off a regular grid: half of one by rounding, and what is fitted
_FEWEST = 20  # values that tell a grid


def grid_step(measured: FloatArray) -> float:
    """Return the usual step [m] between the values that readings have, to a millimetre."""
    values = np.unique(np.rint(measured[np.isfinite(measured)] / _MILLIMETRE))
    return _MILLIMETRE * float(np.median(np.diff(values))) if len(values) > 1 else _MILLIMETRE


def unrounded(measured: FloatArray) -> FloatArray:
    """Return readings [m] as a coarse grid has them, where there is one, before a message rounded its values.

    A grid of 9.97 mm beats with one of 1 mm: over 0.4 m of the range the message is off by half a millimetre either
    way, which is no wave of the laser's.
    """
    if grid_step(measured) < _COARSE * _MILLIMETRE:
        return measured
    known = np.isfinite(measured)
    values, index = np.unique(np.rint(measured[known] / _MILLIMETRE), return_inverse=True)
    if len(values) < _FEWEST:
        return measured
    steps = np.diff(values)
    near = steps[steps < _ADJACENT * np.median(steps)]
    places = np.concatenate([[0.0], np.cumsum(np.rint(steps / near.mean()))])
    even = np.polyval(np.polyfit(places, values, 1), places)
    if np.abs(even - values).max() > _ROUNDED:
        return measured
    out = measured.copy()
    out[known] = _MILLIMETRE * even[index]
    return out
