# SPDX-License-Identifier: BSD-3-Clause
"""What of the readings is outside the catalogue, in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.search import block_evidence
from kurumaisu.critic.ranges.search.block_evidence import BlockComparison, SetWithBlock
from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.critic.unknown.shapes import grid, shape_of
from kurumaisu.critic.values.laser_finding import UNKNOWN_CHANNEL
from kurumaisu.critic.values.verdict import Unknown
from kurumaisu.types import FloatArray

_LISTED = 3
_UNITS = {"range": "m", "hit_x": "m", "hit_y": "m", "time": "s"}  # all others of RANGE_COVARIATES are angles


@dataclass(frozen=True)
class RangeCurve:
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
        column = basis.covariate not in effects.RANGE_COVARIATES  # called as the recording calls it
        name = basis.covariate if column else basis.covariate.replace("_", " ")
        yield Unknown(UNKNOWN_CHANNEL, name, shape(rival, basis, gram), p)


def shape(rival: SetWithBlock, basis: Basis, gram: FloatArray) -> str:
    """Return a curve's shape with place and size, each with its 90 % interval."""
    _, coefficients, covariance = block_evidence.fit_with_block(rival, gram)
    described = RangeCurve(basis, coefficients, covariance)
    found, at = shape_of(described), grid(described)
    unit = _UNITS.get(basis.covariate, "rad" if basis.covariate in effects.RANGE_COVARIATES else "")
    size, low, high = 1e3 * (np.abs(found.size) if found.kind == "line" else found.size)
    told = f"{size:.3g} mm (90 %: {min(low, high):.3g} to {max(low, high):.3g})"
    span = f"from {at[0]:.3g} to {at[-1]:.3g} {unit}".rstrip()
    if found.kind == "line":
        return f"monotone, {'rises' if found.size[0] > 0 else 'falls'} by {told} {span}"
    if found.kind == "irregular":
        return f"irregular, within {told} {span}"
    return f"{found.kind} of {told} at {found.place[0]:.3g} {unit}".rstrip()
