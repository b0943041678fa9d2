# SPDX-License-Identifier: BSD-3-Clause
"""smooth.CHANNEL.COVARIATE: a rate, or what a reference measures, departs by a curve over something that it follows.

What the critic puts into the model for an effect that is not in the catalogue. The mechanism stays unknown.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from kurumaisu.effects.base import BaseEffect, Context, Effect, Follows, Motion, Rate, Reference, ReferenceEffect, Stage
from kurumaisu.effects.smooth_covariates import CONSTANTS, COVARIATES, PERIODIC, Follower
from kurumaisu.errors import Error
from kurumaisu.geometry import compose, cos_sin
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
# What a reference measures of the pose, in the map, by its index there; unit of the curve.
REFERENCE_CHANNELS: Mapping[str, tuple[int, str]] = {
    "reference_x": (0, "m"),
    "reference_y": (1, "m"),
    "reference_heading": (2, "rad"),
}
_ID = re.compile(rf"smooth\.({'|'.join([*CHANNELS, *REFERENCE_CHANNELS])})\.([A-Za-z][\w.]*)")
_MOST = 64  # knots


class _Curve(BaseEffect):
    """A curve over a covariate.

    It is straight between knots and constant beyond the outer ones; over a periodic covariate, or with a period over
    another one, it is a sum of a level, sines and cosines.
    """

    parameters = ()
    source = "the critic, from a recording"
    shows_in = Rate.V
    follows = Follows.V

    channel: ClassVar[str]
    covariate: ClassVar[str]

    @classmethod
    def check(cls, values: Mapping[str, float]) -> None:
        """Raise Error for a parameter that is missing, unknown or not finite, and for knots that do not increase."""
        constant, periodic = constant_of(cls.covariate), _periodic(cls.covariate, values)
        own = [constant] if constant else ["period"] if periodic else []
        first, second = ("cos", "sin") if periodic else ("knot", "value")
        start = 1 if periodic else 0
        count = sum(name.startswith(f"{first}_") for name in values)
        names = [f"{stem}_{i}" for stem in (first, second) for i in range(start, start + count)]
        names += [*own, *(["level"] if periodic else [])]
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

    @property
    def constant(self) -> float:
        """Return the parameter that the covariate needs beside the curve, 0 where it needs none."""
        name = constant_of(self.covariate)
        return self.values[name] if name else 0.0


class Smooth(_Curve, Effect):
    """A curve added to one rate of a moving chair; made by smooth_of."""

    stage = Stage.FLOOR
    sentence = "an unknown effect changes a rate by a curve over another quantity"
    formula = "rate + curve(covariate) while moving"

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        self._follower = Follower(self.covariate, 0.0)
        super().__init__(values, context)

    def change(self, values: Mapping[str, float]) -> None:
        """Go on with another curve, from what the covariate has come to."""
        super().change(values)
        self._follower.constant = self.constant

    def settle(self, motion: Motion) -> None:
        """Have been asked for the same, in the same direction."""
        self._follower.settle(motion)

    def apply(self, motion: Motion) -> Motion:
        """Add the curve, times a rate or not, to the channel's rate where the chair moves."""
        channel = CHANNELS[self.channel]
        added = motion.moving * curve(self.covariate, self.values, self._follower.values(motion))
        added = added * factor(channel, motion)
        rate = _MOVED[channel.rate]
        before = getattr(motion, rate)
        moved: dict[str, Any] = {rate: added if before is None else before + added}
        return replace(motion, **moved)


class SmoothReference(_Curve, ReferenceEffect):
    """A curve added to one part of the pose that a reference measures; made by smooth_of. Its rates stay."""

    sentence = "an unknown effect changes what the reference measures by a curve over another quantity"
    formula = "pose in the map + curve(covariate)"

    def apply(self, reference: Reference) -> Reference:
        """Add the curve to x, y or heading in the map."""
        poses, rates, known = reference.poses, reference.rates, reference.known
        own = {"x": poses[..., 0], "y": poses[..., 1], "heading": poses[..., 2], "v": rates[..., 0], "w": rates[..., 2]}
        at = known.get(self.covariate, own.get(self.covariate))
        added = curve(self.covariate, self.values, np.asarray(self.constant if at is None else at, dtype=float))
        # The heading in the map is what is known of it: poses may be in a frame of their own.
        cos, sin = cos_sin(np.asarray(known.get("heading", own["heading"])))
        none = np.zeros_like(cos)
        axis, _ = REFERENCE_CHANNELS[self.channel]
        along = ((cos, -sin, none), (sin, cos, none), (none, none, none + 1))[axis]
        shift = np.asarray(added)[..., np.newaxis] * np.stack(along, axis=-1)
        return replace(reference, poses=compose(poses, shift))


def factor(channel: RateChannel, motion: Motion) -> FloatArray:
    """Return by what a curve is multiplied before it is added to a channel's rate, (n,)."""
    return _BY[channel.by](motion)


@cache
def smooth_of(name: str) -> type[BaseEffect] | None:
    """Return the effect of an id smooth.CHANNEL.COVARIATE, None for another one."""
    match = _ID.fullmatch(name)
    if match is None:
        return None
    channel, covariate = match.groups()
    text = f"an unknown effect changes {channel} with {covariate}"
    kind = SmoothReference if channel in REFERENCE_CHANNELS else Smooth
    return type(kind.__name__, (kind,), {"id": name, "channel": channel, "covariate": covariate, "sentence": text})


def smooth_id(channel: str, covariate: str) -> str:
    """Return the id of the effect on a channel that follows a covariate."""
    return f"smooth.{channel}.{covariate}"


def constant_of(covariate: str) -> str | None:
    """Return the name of the parameter that a covariate needs beside its curve, None for most."""
    if covariate in CONSTANTS:
        return CONSTANTS[covariate][0]
    return None if covariate in COVARIATES else "now"


def curve(covariate: str, values: Mapping[str, float], at: FloatArray) -> FloatArray:
    """Return the curve of parameters at values of the covariate, in the unit of the channel."""
    if not _periodic(covariate, values):
        return np.asarray(np.interp(at, numbered(values, "knot", 0), numbered(values, "value", 0)))
    cosines, sines = numbered(values, "cos", 1), numbered(values, "sin", 1)
    phase = np.multiply.outer(2 * np.pi * at / values["period"], np.arange(1, len(cosines) + 1))
    return np.asarray(values["level"] + np.cos(phase) @ cosines + np.sin(phase) @ sines)


def _periodic(covariate: str, values: Mapping[str, float]) -> bool:
    """Tell whether a curve of parameters is periodic."""
    return covariate in PERIODIC or "period" in values


def numbered(values: Mapping[str, float], stem: str, start: int) -> FloatArray:
    """Return the parameters stem_i in their order, from i = start on."""

    def find() -> Iterator[float]:
        i = start
        while f"{stem}_{i}" in values:
            yield values[f"{stem}_{i}"]
            i += 1

    return np.array(list(find()))
