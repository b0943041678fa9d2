# SPDX-License-Identifier: BSD-3-Clause
"""base.caster_reversal: when the chair reverses, its casters swing round and kick it to one side."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import RESTS, Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import BoolArray, FloatArray

# [s] A turn shorter than this before a reversal swings no caster. In a step within which the commands change, the mean
# has part of the next turn already; which side it has must not depend on where in the step that was.
_SWING = 0.03
# [m/s], [rad/s] from which a chair drives one way, or turns to one side: a veer or a lever of the axis is no turn of
# the casters, and one that spins does not reverse.
_DRIVES, _TURNS = 0.02, 0.05


class CasterReversal(Effect):
    """After each change of the driving direction an additional yaw rate, which dies away with the distance.

    Its side, by `by`: 0 that of the last turn before the reversal, which is where the casters stand; 1 the same as long
    as the chair then drives forward, the other one backward, where it follows its casters; 2 always the same, as of one
    caster that is stiff; 3 the same, but the other one backward.
    """

    id = "base.caster_reversal"
    stage = Stage.FLOOR
    parameters = (
        Parameter("kick", "rad/s", null=0.0, scale=0.1, lower=-2.0, upper=2.0),
        Parameter("length", "m", null=0.25, scale=0.25, lower=0.01, upper=5.0),
        Parameter("by", "1", null=0.0, scale=1.0, lower=0.0, upper=3.0),
    )
    forms = ({"by": 0.0}, {"by": 1.0}, {"by": 2.0}, {"by": 3.0})
    empirical = True
    sentence = "after a reversal the chair swings to one side until its casters have turned"
    formula = (
        "w ± kick · exp(−s / length) while driving; s: distance since the reversal, ±: side of the last turn; "
        "by = 1: the other side in reverse, 2: always +, 3: + forward, − in reverse"
    )
    source = "study of front casters in reverse, 2003: worst from 90°; 0.05-0.3 rad/s over 0.25 m"
    shows_in = Rate.W
    follows = Follows.V_CHANGE

    _direction = 0.0  # last direction driven, 0: none yet
    _turns: FloatArray | None = None  # sides of the last turn, (k,) steps
    _side = 0.0  # of the kick under way
    _travel = 0.0  # [m] since the last reversal

    def apply(self, motion: Motion) -> Motion:
        """Kick w after reversals; a step counts with the distance at its middle."""
        direction = _held(_signs(motion.v, _DRIVES), self._direction)
        if self._turns is None:
            self._turns = np.zeros(max(round(_SWING / motion.dt), 1))
        past = self._turns
        turns = np.concatenate([past, _held(self._sides(motion.w), float(past[-1]))])
        earlier = np.concatenate([[self._direction], direction[:-1]])
        reversed_here = (direction != earlier) & (earlier != 0)
        side = _last(reversed_here, turns[: len(motion.w)], self._side)
        way = np.abs(motion.v) * motion.dt
        gone = np.concatenate([[0.0], np.cumsum(way)])
        since = gone[:-1] - _last(reversed_here, gone[:-1], -self._travel)
        kick = self.values["kick"] * np.exp(-(since + way / 2) / self.values["length"])
        self._direction, self._turns, self._side = float(direction[-1]), turns[-len(past) :], float(side[-1])
        self._travel = float(since[-1] + way[-1])
        side = side * direction if round(self.values["by"]) in (1, 3) else side
        return replace(motion, w=motion.w + side * kick * (np.abs(motion.v) > RESTS))

    def settle(self, motion: Motion) -> None:
        """Have the casters trail."""
        self._direction = float(_signs(motion.v, _DRIVES)[-1])
        self._turns = np.full(max(round(_SWING / motion.dt), 1), self._sides(motion.w)[-1])

    def _sides(self, w: FloatArray) -> FloatArray:
        """Return to which side turns put the casters, (n,), 0 where they leave them."""
        return np.ones(len(w)) if round(self.values["by"]) in (2, 3) else _signs(w, _TURNS)


def _signs(rates: FloatArray, least: float) -> FloatArray:
    """Return the signs of rates (n,), 0 of those that are smaller than the least."""
    return np.asarray(np.sign(rates) * (np.abs(rates) >= least))


def _held(signs: FloatArray, before: float) -> FloatArray:
    """Return signs (n,) with the last one before in place of each 0."""
    return _last(signs != 0, signs, before)


def _last(where: BoolArray, values: FloatArray, before: float) -> FloatArray:
    """Return, for each sample, the value where the condition held last, up to it; before: while it never did."""
    index = np.maximum.accumulate(np.where(where, np.arange(1, len(values) + 1), 0))
    return np.asarray(np.concatenate([[before], values])[index])
