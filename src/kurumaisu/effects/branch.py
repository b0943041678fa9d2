# SPDX-License-Identifier: BSD-3-Clause
"""The two branches of a voltage law: where each ends, and what lies beyond the one that was meant."""

import numpy as np

from kurumaisu._core import AxisLaw
from kurumaisu.types import BoolArray, FloatArray


def end_of_branch(law: AxisLaw, side: FloatArray) -> FloatArray:
    """Return the voltage [V] of no rate at all on the branches of rates of a sign (n,)."""
    return np.where(side < 0, law.negative.intercept, law.positive.intercept)


def beyond_branch(law: AxisLaw, volts: FloatArray, side: FloatArray) -> BoolArray:
    """Return which voltages (n,) [V] stand for a rate of the other sign than was meant; none where that is unknown."""
    slope = np.where(side < 0, law.negative.slope, law.positive.slope)
    return np.asarray(side * (volts - end_of_branch(law, side)) / slope < 0)
