# SPDX-License-Identifier: BSD-3-Clause
"""Recordings with something hidden in them, by code that shares nothing with effects, simulator or critic.

    from kurumaisu.bench.hidden import Ask, make
    case = make(Ask("single", ("base.lag_w",)), seed=3)
    case = make(Ask("single", ("laser.tilt",)), seed=3, folder=Path("worlds"))
    case.recording, case.null, case.truth

Seeds 0 to 999 are for tuning, those from 1000 on for reports.
"""

from kurumaisu.bench.hidden.generator.case import Ask, Case, Truth
from kurumaisu.bench.hidden.make import make, names_of

__all__ = ["Ask", "Case", "Truth", "make", "names_of"]
