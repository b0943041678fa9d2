# SPDX-License-Identifier: BSD-3-Clause
"""The chair as a plant: voltages (or commands) in, rates out, with the effects of the model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from kurumaisu import _core, effects
from kurumaisu._core import AxisInverse, AxisLaw
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_ASKED, _OUT = "asked", "out"  # before and after all effects


class Driven(Protocol):
    """What Plant needs to know of a Model."""

    @property
    def translation(self) -> AxisLaw:
        """Of V_f."""

    @property
    def steering(self) -> AxisLaw:
        """Of V_s."""

    @property
    def effects(self) -> tuple[EffectSetting, ...]:
        """Those that act."""


class Plant:
    """Turns inputs into rates on a uniform time grid, chunk by chunk."""

    def __init__(self, model: Driven, dt: float, rng: np.random.Generator) -> None:
        """Start at rest, with the effects of the model; dt [s] is the grid's step.

        Raise Error for effects that are unknown or whose parameters do not fit.
        """
        self.dt = dt
        self._model = model
        self._translation = AxisInverse(model.translation)
        self._steering = AxisInverse(model.steering)
        self._context = effects.Context(translation=model.translation, steering=model.steering, rng=rng)
        self.effects = effects.build(model.effects, self._context)
        self._passed: dict[str, tuple[float, float]] = {}  # v, w that last came to each effect, by ids; and two more

    @property
    def ambiguous_samples(self) -> int:
        """Samples so far whose voltages stood for two rates."""
        return int(self._translation.ambiguous_samples + self._steering.ambiguous_samples)

    def from_voltages(
        self, volts: effects.Volts, heading: float | None = None, known: Mapping[str, FloatArray] | None = None
    ) -> effects.Motion:
        """Return the motion for voltages; heading [rad] of the chair before them, if somebody knows it.

        known: what else is known of each step, as Motion has it.
        """
        known = {"v_f": volts.v_f, "v_s": volts.v_s, **(known or {})}
        for effect in self.effects.volts:
            volts = effect.apply(volts)
        v = self._translation.rates(volts.v_f, volts.sign_v)
        w = self._steering.rates(volts.v_s, volts.sign_w)
        return self._respond(v, w, heading, known)

    def from_rates(
        self, v: FloatArray, w: FloatArray, heading: float | None = None, known: Mapping[str, FloatArray] | None = None
    ) -> effects.Motion:
        """Return the motion for commanded rates, both (n,); known: as from_voltages has it."""
        if not self.effects.volts:
            return self._respond(v, w, heading, known or {})
        model = self._model
        volts = effects.Volts(model.translation.volts(v), model.steering.volts(w), np.sign(v), np.sign(w))
        return self.from_voltages(volts, heading, known)

    def switch(self, settings: tuple[EffectSetting, ...], time: float) -> None:
        """Go on with these effects from a time [s] on, in the middle of the drive.

        Those that act already keep their state; others begin as if the last step's rates had been held for long.
        Raise Error, with nothing changed, for effects that are unknown or whose parameters do not fit.
        """
        effects.check(settings)
        before = {effect.id for effect in self.effects.all}
        self.effects = effects.build(settings, self._context, self.effects)
        for effect in self.effects.all:
            if effect.id not in before:
                effect.since = time
        if not self._passed:
            return  # nothing has moved yet
        v, w = self._passed[_OUT]
        asked = {
            name: np.array([rate]) for name, rate in zip(("v_asked", "w_asked"), self._passed[_ASKED], strict=True)
        }
        for rate in reversed(self.effects.rates):
            if rate.id in before:
                v, w = self._passed[rate.id]
            else:
                self._passed[rate.id] = v, w
                rate.settle(effects.Motion(self.dt, np.array([v]), np.array([w]), known=asked))

    def seen(self, reference: effects.Reference) -> effects.Reference:
        """Return what a reference measures where the truth is as given."""
        for effect in self.effects.reference:
            reference = effect.apply(reference)
        return reference

    def _respond(
        self, v: FloatArray, w: FloatArray, heading: float | None, known: Mapping[str, FloatArray]
    ) -> effects.Motion:
        motion = effects.Motion(self.dt, v, w, heading=heading, known={"v_asked": v, "w_asked": w, **known})
        self._note(_ASKED, motion)
        for effect in self.effects.rates:
            self._note(effect.id, motion)
            motion = effect.apply(motion)
        self._note(_OUT, motion)
        return motion

    def _note(self, place: str, motion: effects.Motion) -> None:
        self._passed[place] = float(motion.v[-1]), float(motion.w[-1])


def path(motion: effects.Motion, start: FloatArray) -> FloatArray:
    """Return poses (n + 1, 3) [m, m, rad] from a start (3,) on, by equation (3).

    A leftward speed adds the path of a chair that heads to the left.
    """
    dt = np.full(len(motion.v), motion.dt)
    poses = _core.integrate(motion.v, motion.w, dt, start.tolist())
    if motion.u is not None:
        poses[:, :2] += _core.integrate(motion.u, motion.w, dt, [0.0, 0.0, start[2] + math.pi / 2])[:, :2]
    return poses
