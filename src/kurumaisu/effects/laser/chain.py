# SPDX-License-Identifier: BSD-3-Clause
"""All effects of one laser, from the beams' poses to their readings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import BeamEffect, Beams, Echoes, LaserEffect, LaserStage, ReadingEffect
from kurumaisu.types import FloatArray

_Cast = Callable[[FloatArray, FloatArray], FloatArray]  # poses (n, 3), bearings (n,) [rad] -> ranges (n,) [m]
_BESIDE = 1e-6  # [rad] a ray this far from another meets the same wall, or hardly ever not


class LaserChain:
    """The effects of one laser in the order in which they act; each keeps its state from scan to scan."""

    def __init__(self, effects: Sequence[LaserEffect]) -> None:
        """Take effects in their order."""
        self.empty = not effects
        self._beams = [effect for effect in effects if isinstance(effect, BeamEffect)]
        readings = [effect for effect in effects if isinstance(effect, ReadingEffect)]
        self.oblique = any(effect.oblique for effect in readings)
        self._before = [effect for effect in readings if effect.stage <= LaserStage.NOISE]
        self._after = [effect for effect in readings if effect.stage > LaserStage.NOISE]

    @property
    def effects(self) -> tuple[LaserEffect, ...]:
        """All of them."""
        return *self._beams, *self._before, *self._after

    def aim(self, beams: Beams) -> Beams:
        """Return where the beams leave from in truth, and when, for what model and message say."""
        for effect in self._beams:
            beams = effect.apply(beams)
        return beams

    def read(self, echoes: Echoes) -> FloatArray:
        """Return readings (n,) or (k, n) [m], neither rounded nor gated: +inf no return, NaN no valid reading.

        echoes: ranges may be +inf; mean, sd and noise as the laser has them without effects; readings do not count.
        """
        hit = np.isfinite(echoes.ranges)
        ranges = echoes.ranges
        echoes = replace(
            echoes,
            ranges=np.where(hit, ranges, 0.0),
            mean=np.where(hit, echoes.mean, 0.0),
            sd=np.where(hit, echoes.sd, 0.0),
        )
        for effect in self._before:
            echoes = effect.apply(echoes)
        readings = np.where(hit, echoes.mean + echoes.sd * echoes.noise, np.inf)
        echoes = replace(echoes, ranges=ranges, readings=readings)
        for effect in self._after:
            echoes = effect.apply(echoes)
        return echoes.readings


def slanted(ranges: FloatArray, beams: Beams) -> FloatArray:
    """Return ranges (n,) [m] along beams to vertical walls that are so far on the level, or to the floor if nearer."""
    if not beams.elevations.any():
        return ranges
    with np.errstate(divide="ignore", over="ignore"):  # level, or nearly: no floor
        floor = np.where(beams.elevations < 0, beams.height / -np.sin(np.minimum(beams.elevations, 0.0)), np.inf)
    return np.minimum(ranges / np.cos(beams.elevations), floor)


def incidence(cast: _Cast, poses: FloatArray, bearings: FloatArray, ranges: FloatArray) -> FloatArray:
    """Return the angles (n,) [rad] between level beams and the normals of what they meet; 0 where that is nothing.

    Two rays beside each beam show how its wall lies. Where one of them meets another wall than the beam, the other
    one counts, as a wall goes on and a jump does not.
    """
    slopes = []
    for side in (-_BESIDE, _BESIDE):
        beside = cast(poses, bearings + side)
        # In the beam's frame the wall runs from (r, 0) to (r' cos d, r' sin d): forward by `along` per leftward metre.
        with np.errstate(invalid="ignore", divide="ignore"):
            slopes.append((beside * np.cos(side) - ranges) / (beside * np.sin(side)))
    steepest = 1e9  # of a jump, or of a beam that meets nothing
    left, right = (np.where(np.isfinite(slope), np.abs(slope), steepest) for slope in slopes)
    angle = np.arctan(np.minimum(left, right))
    return np.asarray(np.where(np.isfinite(ranges), angle, 0.0))
