# SPDX-License-Identifier: BSD-3-Clause
"""A clock that runs fast or slow, nobody knows from when on: if it agreed later than at 0, a delay is a part of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.values.laser_finding import LaserFinding
from kurumaisu.critic.values.verdict import Cause
from kurumaisu.effects import BeamEffect, Beams
from kurumaisu.types import FloatArray

_NEAR = 5.0  # [s] of the first scan: so long before or after it a recording may have begun
_SURE = 1.8  # times half of a 90 % interval: three standard deviations
_LATER = 1000.0  # [s] at which a clock's drift is looked at
_NONE = 1e-9  # [s] a shift that is none


@dataclass(frozen=True)
class _Clock:
    """By how much a cause moves the time of a scan: at [s] time 0; growth [1] since then; half of its interval [s]."""

    at: float
    growth: float
    half: float


def without_double_delay(finding: LaserFinding, stamps: FloatArray) -> LaserFinding:
    """Return a finding without a cause of its own for a delay that only says that the clocks agreed at the first scan.

    stamps [s] of the scans, since time 0 of the laser. The model keeps the delay: its clocks agree at time 0.
    """
    first = float(stamps.min())
    if first < _NEAR:
        return finding
    clocks = {cause.id: _clock(cause) for cause in finding.causes}
    drifts = [(name, clock) for name, clock in clocks.items() if clock and abs(clock.growth) * _LATER > _NONE]
    delays = [(name, clock) for name, clock in clocks.items() if clock and abs(clock.growth) * _LATER <= _NONE]
    if len(drifts) != 1 or len(delays) != 1:
        return finding
    (drifting, drift), (late, delay) = *drifts, *delays
    agreed = -(delay.at + drift.at) / drift.growth
    if abs(agreed - first) > _NEAR + _SURE * delay.half / abs(drift.growth):
        return finding
    told = f"{drifting}: the clocks agreed {agreed:.3g} s after time 0; the model has this as a delay."
    return replace(finding, causes=tuple(c for c in finding.causes if c.id != late), details=(*finding.details, told))


def _clock(cause: Cause) -> _Clock | None:
    """Return what a cause does to the time of a whole scan; None if that is nothing."""
    effect = effects.by_id(cause.id)
    if not issubclass(effect, BeamEffect):
        return None

    def shift(stamp: float, end: str = "estimate") -> float:
        values = {p.name: p.null for p in effect.parameters}
        values |= {name: float(getattr(one, end)) for name, one in cause.parameters.items()}
        return float(effect(values, np.random.default_rng(0)).apply(Beams.single(stamp)).times[0]) - stamp

    at, growth = shift(0.0), (shift(_LATER) - shift(0.0)) / _LATER
    half = abs(shift(0.0, "hi90") - shift(0.0, "lo90")) / 2
    return _Clock(at, growth, half) if max(abs(at), abs(growth) * _LATER) > _NONE else None
