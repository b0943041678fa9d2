# SPDX-License-Identifier: BSD-3-Clause
"""A clock that runs fast or slow, nobody knows from when on: if it agreed later than at 0, a delay is a part of it."""

from __future__ import annotations

from dataclasses import replace

from kurumaisu.critic.laser.finding import LaserFinding
from kurumaisu.critic.verdict import Estimate
from kurumaisu.types import FloatArray

_SKEW, _DELAY = "laser.clock_skew", "laser.latency"
_NEAR = 5.0  # [s] of the first scan: so long before or after it a recording may have begun
_SURE = 1.8  # times half of a 90 % interval: three standard deviations


def one_clock(finding: LaserFinding, stamps: FloatArray) -> LaserFinding:
    """Return a finding without a cause of its own for a delay that only says that the clocks agreed at the first scan.

    stamps [s] of the scans, since time 0 of the laser. The model keeps the delay: its clocks agree at time 0.
    """
    causes = {cause.id: cause for cause in finding.causes}
    first = float(stamps.min())
    if first < _NEAR or not {_SKEW, _DELAY} <= set(causes):
        return finding
    skew, delay = causes[_SKEW].parameters["skew"], causes[_DELAY].parameters["delay"]
    # Beams are fired at t - delay - skew t, which is t at this time.
    agreed = -delay.estimate / skew.estimate
    if abs(agreed - first) > _NEAR + _SURE * _half(delay) / abs(skew.estimate):
        return finding
    told = f"{_SKEW}: the clocks agreed {agreed:.3g} s after time 0; the delay in the model says so."
    return replace(finding, causes=tuple(c for c in finding.causes if c.id != _DELAY), details=(*finding.details, told))


def _half(estimate: Estimate) -> float:
    return (estimate.hi90 - estimate.lo90) / 2
