# SPDX-License-Identifier: BSD-3-Clause
"""What of the readings is outside the catalogue, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.search import block_evidence
from kurumaisu.critic.ranges.search.block_evidence import BlockComparison
from kurumaisu.critic.scatter.curves import ScatterCurve
from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.critic.unknown.shapes import grid, shape_of
from kurumaisu.critic.values.laser_finding import UNKNOWN_CHANNEL, UNKNOWN_POSE, UNKNOWN_SCATTER
from kurumaisu.critic.values.verdict import Unknown
from kurumaisu.types import FloatArray

_LISTED = 3
# All others of RANGE_COVARIATES are angles.
_UNITS = dict.fromkeys(("range", "hit_x", "hit_y", "x", "y"), "m") | {"time": "s", "v": "m/s", "w": "rad/s"}


@dataclass(frozen=True)
class ReadingCurve:
    """A curve with its coefficients (m,) and their covariance (m, m), as shapes describes it."""

    basis: Basis
    coefficients: FloatArray
    covariance: FloatArray


def unknowns(weighed: BlockComparison, gram: FloatArray) -> Iterator[Unknown]:
    """Yield the curve that acts, and the next ones that could stand in for it."""
    seen: set[str] = set()
    first = () if weighed.winner is None else (weighed.winner,)
    for rival in (*first, *weighed.rivals):
        basis = rival.free.basis
        if basis is None or rival.free.id in seen or len(seen) == _LISTED:
            continue
        seen.add(rival.free.id)
        p = min(weighed.p[rival.free.id], 1.0)
        _, coefficients, covariance = block_evidence.fit_with_block(rival, gram)
        curve = ReadingCurve(basis, 1e3 * coefficients, 1e6 * covariance)
        channel, unit = (UNKNOWN_CHANNEL, "mm") if rival.free.pose is None else UNKNOWN_POSE[rival.free.pose]
        yield Unknown(channel, _called(basis), shape(curve, unit), p)


def unknown_scatter(curves: Sequence[ScatterCurve]) -> Iterator[Unknown]:
    """Yield the curve that the noise of readings follows, and the next ones that could stand in for it."""
    for one in curves[:_LISTED]:
        curve = ReadingCurve(one.basis, 100 * one.coefficients, 1e4 * one.covariance)
        yield Unknown(UNKNOWN_SCATTER, _called(one.basis), f"of the noise: {shape(curve, '%')}", one.p)


def _called(basis: Basis) -> str:
    """Return what a reader calls a covariate: a column as the recording calls it."""
    return basis.covariate.replace("_", " ") if basis.covariate in effects.RANGE_COVARIATES else basis.covariate


def shape(curve: ReadingCurve, of: str) -> str:
    """Return a curve's shape with place and size, each with its 90 % interval; of: its unit."""
    found, at = shape_of(curve), grid(curve)
    basis = curve.basis
    unit = _UNITS.get(basis.covariate, "rad" if basis.covariate in effects.RANGE_COVARIATES else "")
    size, low, high = np.abs(found.size) if found.kind == "line" else found.size
    told = f"{size:.3g} {of} (90 %: {min(low, high):.3g} to {max(low, high):.3g})"
    span = f"from {at[0]:.3g} to {at[-1]:.3g} {unit}".rstrip()
    if found.kind == "line":
        return f"monotone, {'rises' if found.size[0] > 0 else 'falls'} by {told} {span}"
    if found.kind == "irregular":
        return f"irregular, within {told} {span}"
    return f"{found.kind} of {told} at {found.place[0]:.3g} {unit}".rstrip()
