# SPDX-License-Identifier: BSD-3-Clause
"""smooth.CHANNEL.COVARIATE: a rate departs from the model by a curve over something that it follows.

What the critic puts into the model for an effect that is not in the catalogue. The mechanism stays unknown.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from kurumaisu.effects.base import Context, Effect, Follows, Motion, Rate, Stage
from kurumaisu.effects.smooth_covariates import CONSTANTS, COVARIATES, PERIODIC, Follower
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

SMOOTH = "smooth"  # stands for every curve where effects are chosen by id
_BY: Mapping[str, Callable[[Motion], FloatArray]] = {
    "": lambda motion: np.ones_like(motion.v),
    "v": lambda motion: motion.v,
    "w": lambda motion: motion.w,
    "direction": lambda motion: np.sign(motion.v),
}
_MOVED = {"v": "v", "lateral": "u", "w": "w"}  # the rates of a motion by name


class RateChannel(NamedTuple):
    """A rate that gets a curve added, times what `by` names, if anything; unit: of the curve."""

    unit: str
    rate: str
    by: str = ""


# What slips takes a share of a rate in either direction, what drags as much of any speed; a tyre without air bends the
# way, however fast it is driven.
CHANNELS: Mapping[str, RateChannel] = {
    "v": RateChannel("m/s", "v"),
    "lateral": RateChannel("m/s", "lateral"),
    "w": RateChannel("rad/s", "w"),
    "v_gain": RateChannel("1", "v", "v"),
    "w_gain": RateChannel("1", "w", "w"),
    "curvature": RateChannel("rad/m", "w", "v"),
    "speed": RateChannel("m/s", "v", "direction"),
}
_ID = re.compile(rf"smooth\.({'|'.join(CHANNELS)})\.([A-Za-z][\w.]*)")
_MOST = 64  # knots


class Smooth(Effect):
    """A curve over a covariate, added to one rate of a moving chair; made by smooth_of.

    The curve is straight between knots and constant beyond the outer ones; over a periodic covariate it is a sum of
    a level, sines and cosines.
    """

    stage = Stage.FLOOR
    parameters = ()
    sentence = "an unknown effect changes a rate by a curve over another quantity"
    formula = "rate + curve(covariate) while moving"
    source = "the critic, from a recording"
    shows_in = Rate.V
    follows = Follows.V

    channel: ClassVar[str]
    covariate: ClassVar[str]

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        self._follower = Follower(self.covariate, 0.0)
        super().__init__(values, context)

    def change(self, values: Mapping[str, float]) -> None:
        """Go on with another curve, from what the covariate has come to."""
        super().change(values)
        constant = constant_of(self.covariate)
        self._follower.constant = values[constant] if constant else 0.0

    def settle(self, motion: Motion) -> None:
        """Have been asked for the same, in the same direction."""
        self._follower.settle(motion)

    @classmethod
    def check(cls, values: Mapping[str, float]) -> None:
        """Raise Error for a parameter that is missing, unknown or not finite, and for knots that do not increase."""
        constant = constant_of(cls.covariate)
        own = [constant] if constant else []
        first, second = ("cos", "sin") if cls.covariate in PERIODIC else ("knot", "value")
        start = 1 if cls.covariate in PERIODIC else 0
        count = sum(name.startswith(f"{first}_") for name in values)
        names = [f"{stem}_{i}" for stem in (first, second) for i in range(start, start + count)]
        names += [*own, *(["level"] if cls.covariate in PERIODIC else [])]
        if sorted(values) != sorted(names) or not 1 <= count <= _MOST:
            wanted = [*own, *(["level"] if start else []), f"{first}_{start}, ...", f"{second}_{start}, ..."]
            raise Error(f"{cls.id}: needs the parameters {', '.join(wanted)}; got {', '.join(values) or 'none'}")
        for name, value in values.items():
            if not np.isfinite(value) or (name == "period" and value <= 0):
                raise Error(
                    f"{cls.id}: {name} must be a {'positive' if name == 'period' else 'finite'} number: {value}"
                )
        if not start and (np.diff(numbered(values, "knot", 0)) <= 0).any():
            raise Error(f"{cls.id}: knots must increase: {numbered(values, 'knot', 0)}")

    def apply(self, motion: Motion) -> Motion:
        """Add the curve, times a rate or not, to the channel's rate where the chair moves."""
        channel = CHANNELS[self.channel]
        added = motion.moving * curve(self.covariate, self.values, self._follower.values(motion))
        added = added * factor(channel, motion)
        rate = _MOVED[channel.rate]
        before = getattr(motion, rate)
        moved: dict[str, Any] = {rate: added if before is None else before + added}
        return replace(motion, **moved)


def factor(channel: RateChannel, motion: Motion) -> FloatArray:
    """Return by what a curve is multiplied before it is added to a channel's rate, (n,)."""
    return _BY[channel.by](motion)


@cache
def smooth_of(name: str) -> type[Smooth] | None:
    """Return the effect of an id smooth.CHANNEL.COVARIATE, None for another one."""
    match = _ID.fullmatch(name)
    if match is None:
        return None
    channel, covariate = match.groups()
    text = f"an unknown effect changes {channel} with {covariate}"
    return type("Smooth", (Smooth,), {"id": name, "channel": channel, "covariate": covariate, "sentence": text})


def smooth_id(channel: str, covariate: str) -> str:
    """Return the id of the effect on a channel (v, lateral, w) that follows a covariate."""
    return f"smooth.{channel}.{covariate}"


def constant_of(covariate: str) -> str | None:
    """Return the name of the parameter that a covariate needs beside its curve, None for most."""
    if covariate in CONSTANTS:
        return CONSTANTS[covariate][0]
    return None if covariate in COVARIATES else "now"


def curve(covariate: str, values: Mapping[str, float], at: FloatArray) -> FloatArray:
    """Return the curve of parameters at values of the covariate, in the unit of the channel."""
    if covariate not in PERIODIC:
        return np.asarray(np.interp(at, numbered(values, "knot", 0), numbered(values, "value", 0)))
    cosines, sines = numbered(values, "cos", 1), numbered(values, "sin", 1)
    phase = np.multiply.outer(2 * np.pi * at / values["period"], np.arange(1, len(cosines) + 1))
    return np.asarray(values["level"] + np.cos(phase) @ cosines + np.sin(phase) @ sines)


def numbered(values: Mapping[str, float], stem: str, start: int) -> FloatArray:
    """Return the parameters stem_i in their order, from i = start on."""

    def find() -> Iterator[float]:
        i = start
        while f"{stem}_{i}" in values:
            yield values[f"{stem}_{i}"]
            i += 1

    return np.array(list(find()))
