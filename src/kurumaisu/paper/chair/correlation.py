# SPDX-License-Identifier: BSD-3-Clause
"""What goes with what, figures 3 to 6."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.paper.chair.samples import Samples
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Correlations:
    """Of the rates with the voltages over all steady samples, as in figures 3 to 6; drive: of V_f with V_s."""

    v_with_f: float
    v_with_s: float
    w_with_f: float
    w_with_s: float
    drive: float


def correlations(samples: Samples) -> Correlations:
    """Return the correlations of the steady samples."""
    chosen = samples.of(samples.steady)

    def r(a: FloatArray, b: FloatArray) -> float:
        return float(np.corrcoef(a, b)[0, 1]) if len(a) > 2 and np.ptp(a) > 0 and np.ptp(b) > 0 else np.nan

    return Correlations(
        r(chosen.v, chosen.v_f),
        r(chosen.v, chosen.v_s),
        r(chosen.w, chosen.v_f),
        r(chosen.w, chosen.v_s),
        r(chosen.v_f, chosen.v_s),
    )
