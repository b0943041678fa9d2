# SPDX-License-Identifier: BSD-3-Clause
"""smooth.range.COVARIATE and smooth.scatter.COVARIATE: readings, or their noise, follow a curve over something.

What the critic puts into the model for an effect of the laser that is not in the catalogue.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import ClassVar

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.smooth import numbered
from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.types import FloatArray

_ID = re.compile(r"smooth\.(range|scatter)\.(\w+)")
_MOST = 64  # knots
Reads = Callable[[Echoes], FloatArray]


def _ends(echoes: Echoes, axis: int) -> FloatArray:
    turn = np.cos if axis == 0 else np.sin
    reach = np.where(np.isfinite(echoes.ranges), echoes.ranges, 0.0)
    return np.asarray(_origins(echoes)[..., axis] + reach * turn(_origins(echoes)[..., 2] + echoes.bearings))


def _origins(echoes: Echoes) -> FloatArray:
    assert echoes.origins is not None
    return echoes.origins


# What a curve may follow, of a scan whose echoes know it; angles within half a turn.
RANGE_COVARIATES: Mapping[str, Reads] = {
    "range": lambda echoes: echoes.ranges,
    "incidence": lambda echoes: echoes.incidence,
    "bearing": lambda echoes: echoes.bearings + 0.0 * echoes.ranges,
    "time": lambda echoes: echoes.stamp + 0.0 * echoes.ranges,
    "heading": lambda echoes: wrap(_origins(echoes)[..., 2]),
    "world_bearing": lambda echoes: wrap(_origins(echoes)[..., 2] + echoes.bearings),
    "hit_x": lambda echoes: _ends(echoes, 0),
    "hit_y": lambda echoes: _ends(echoes, 1),
}
_PLACED = ("heading", "world_bearing", "hit_x", "hit_y")


class SmoothReading(ReadingEffect):
    """A curve over a covariate; straight between knots, constant beyond the outer ones.

    A name that is not among RANGE_COVARIATES is a quantity known beside the scans, as in Echoes.known. Where nobody
    knows it, or the laser's pose, curves over it do nothing. Made by smooth_reading_of.
    """

    parameters = ()
    source = "the critic, from a recording"
    covariate: ClassVar[str]

    @classmethod
    def check(cls, values: Mapping[str, float]) -> None:
        """Raise Error for a parameter that is missing, unknown or not finite, and for knots that do not increase."""
        count = sum(name.startswith("knot_") for name in values)
        names = [f"{stem}_{i}" for stem in ("knot", "value") for i in range(count)]
        if sorted(values) != sorted(names) or not 1 <= count <= _MOST:
            raise Error(f"{cls.id}: needs the parameters knot_0, ..., value_0, ...; got {', '.join(values) or 'none'}")
        for name, value in values.items():
            if not np.isfinite(value):
                raise Error(f"{cls.id}: {name} must be a finite number: {value}")
        if (np.diff(numbered(values, "knot", 0)) <= 0).any():
            raise Error(f"{cls.id}: knots must increase: {numbered(values, 'knot', 0)}")

    def curve(self, echoes: Echoes) -> FloatArray | float:
        """Return the curve at the beams (n,)."""
        if self.covariate in _PLACED and echoes.origins is None:
            return 0.0
        reads = RANGE_COVARIATES.get(self.covariate)
        at = echoes.known.get(self.covariate) if reads is None else reads(echoes)
        if at is None:
            return 0.0
        return np.asarray(np.interp(at, numbered(self.values, "knot", 0), numbered(self.values, "value", 0)))


class SmoothRange(SmoothReading):
    """Such a curve [m], added to the mean."""

    stage = LaserStage.BIAS
    formula = "µ + curve(covariate)"

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean by the curve."""
        return replace(echoes, mean=echoes.mean + self.curve(echoes))


class SmoothScatter(SmoothReading):
    """Such a curve [1], the log of a factor of the noise."""

    stage = LaserStage.SPREAD
    formula = "σ · exp(curve(covariate))"

    def apply(self, echoes: Echoes) -> Echoes:
        """Scale the noise by the curve."""
        return replace(echoes, sd=echoes.sd * np.exp(self.curve(echoes)))


_CHANNELS: Mapping[str, tuple[type[SmoothReading], str]] = {
    "range": (SmoothRange, "the ranges"),
    "scatter": (SmoothScatter, "how ranges scatter"),
}


@cache
def smooth_reading_of(name: str) -> type[SmoothReading] | None:
    """Return the effect of an id smooth.range.COVARIATE or smooth.scatter.COVARIATE, None for another one."""
    match = _ID.fullmatch(name)
    if match is None:
        return None
    family, what = _CHANNELS[match[1]]
    text = f"an unknown effect changes {what} with {match[2].replace('_', ' ')}"
    own = {"id": name, "covariate": match[2], "sentence": text, "oblique": match[2] == "incidence"}
    return type(family.__name__, (family,), own)


def smooth_range_id(covariate: str) -> str:
    """Return the id of the effect on readings that follows a covariate."""
    return f"smooth.range.{covariate}"


def smooth_scatter_id(covariate: str) -> str:
    """Return the id of the effect on the noise of readings that follows a covariate."""
    return f"smooth.scatter.{covariate}"
