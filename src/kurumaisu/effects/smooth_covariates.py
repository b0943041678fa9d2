# SPDX-License-Identifier: BSD-3-Clause
"""What an unknown effect may follow: quantities that are known while the chair drives, followed chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from kurumaisu.effects.base import Motion
from kurumaisu.effects.first_order import FirstOrder
from kurumaisu.types import BoolArray, FloatArray

# Followed by sines and cosines, with a period that the model file states: a turn, the girth of a wheel, or a step of
# the D/A converter.
PERIODIC = ("heading", "distance", "v_f", "v_s")
_PERIODS = {"heading": "rad", "distance": "m"}
# A parameter that a covariate needs besides its curve, by its name, with its unit.
CONSTANTS: Mapping[str, tuple[str, str]] = {
    "wheel_left": ("track", "m"),
    "wheel_right": ("track", "m"),
    **{name: ("period", _PERIODS.get(name, "V")) for name in PERIODIC},
}
MOVING = "moving"  # what follows nothing but that the chair moves
RECORDING_TIME = "recording_time"  # [s] since the first run began; known of recordings only
MEANINGS: Mapping[str, str] = {
    "v": "forward speed that the effects before have left [m/s]",
    "abs_v": "its size [m/s]",
    "w": "yaw rate likewise [rad/s]",
    "abs_w": "its size [rad/s]",
    "v_times_w": "their product [m/s²]",
    "acceleration": "change of v, as of a chair that follows 0.2 s late [m/s²]",
    "yaw_acceleration": "change of w likewise [rad/s²]",
    "wheel_left": "speed of the left wheel, v − w · track / 2 [m/s]",
    "wheel_right": "speed of the right wheel, v + w · track / 2 [m/s]",
    "time": "time since the start [s]",
    "since_command": "time since the commanded rates changed [s]",
    "since_rest": "time since the chair last rested [s]",
    "since_reversal": "distance since the driving direction changed [m]",
    "heading": "heading in the map [rad]; periodic",
    "distance": "distance travelled since the start, back or forth [m]; periodic, for wheels out of round",
    "x": "place in the map [m]",
    "y": "place in the map [m]",
    MOVING: "nothing: 1 while the chair moves",
    "v_f": "translation voltage [V]; periodic, for steps of the D/A converter",
    "v_s": "steering voltage [V]; periodic likewise",
}
_FOLLOWS = 0.2  # [s] time constant with which a chair follows at the soonest: rates that jump have no change else
_CHANGED = 1e-6  # [m/s, rad/s] more than rounding: the command is another one


class Follower:
    """One covariate of a motion, with what it remembers from chunk to chunk.

    A name that is not among COVARIATES is a quantity measured beside the drive: it is taken from Motion.known, and
    where nobody knows it, it stays at the constant that the model file gives.
    """

    def __init__(self, name: str, constant: float) -> None:
        self._name, self.constant = name, constant
        self._elapsed = 0.0  # [s]
        self._heading = 0.0  # [rad] before the next chunk, where nobody knows it
        self._position = (0.0, 0.0)  # [m] likewise
        self._asked = (0.0, 0.0)
        self._since = np.inf  # [s] since the last change of the command
        self._moved = np.inf  # [s] since the chair last rested
        self._direction = 0.0  # last direction driven, 0: none yet
        self._travel = np.inf  # [m] since the last reversal
        self._way = 0.0  # [m] since the start
        self._followed = FirstOrder()  # the rate whose change is asked for

    def values(self, motion: Motion) -> FloatArray:
        """Return the covariate in each step, (n,); inf where there was no command, rest or reversal yet."""
        if self._name in motion.known:
            return np.broadcast_to(np.asarray(motion.known[self._name], dtype=float), motion.v.shape)
        function = COVARIATES.get(self._name)
        return np.full(len(motion.v), self.constant) if function is None else function(self, motion)

    def settle(self, motion: Motion) -> None:
        """Begin in the middle of a drive whose rates, and what asks for them, have been held for long."""
        asked = asked_for(motion)
        self._asked = float(asked[0][-1]), float(asked[1][-1])
        self._direction = float(np.sign(motion.v[-1]))
        self._followed.level = float((motion.w if self._name == "yaw_acceleration" else motion.v)[-1])

    def time(self, motion: Motion) -> FloatArray:
        """Return the time since the start, in the middle of each step [s]."""
        ends = self._elapsed + motion.dt * np.arange(1, len(motion.v) + 1)
        self._elapsed = float(ends[-1])
        return np.asarray(ends - motion.dt / 2)

    def heading(self, motion: Motion) -> FloatArray:
        """Return the heading in the map in the middle of each step [rad]."""
        before = self._heading if motion.heading is None else motion.heading
        after = before + np.cumsum(motion.w) * motion.dt
        self._heading = float(after[-1])
        return np.asarray(after - motion.w * motion.dt / 2)

    def distance(self, motion: Motion) -> FloatArray:
        """Return the distance travelled since the start, in the middle of each step [m]."""
        way = np.abs(motion.v) * motion.dt
        after = self._way + np.cumsum(way)
        self._way = float(after[-1])
        return np.asarray(after - way / 2)

    def place(self, motion: Motion, axis: int) -> FloatArray:
        """Return x (axis 0) or y (axis 1) from the start on, in the middle of each step [m]."""
        heading = self.heading(motion)
        u = np.zeros_like(motion.v) if motion.u is None else motion.u
        x = motion.v * np.cos(heading) - u * np.sin(heading)
        y = motion.v * np.sin(heading) + u * np.cos(heading)
        steps = np.stack([x, y]) * motion.dt
        after = np.asarray(self._position)[:, None] + np.cumsum(steps, axis=1)
        self._position = (float(after[0, -1]), float(after[1, -1]))
        return np.asarray((after - steps / 2)[axis])

    def since_command(self, motion: Motion) -> FloatArray:
        """Return the time since what is asked for changed, in the middle of each step [s]."""
        asked = np.stack(asked_for(motion))
        earlier = np.column_stack([self._asked, asked[:, :-1]])
        ages = _since((np.abs(asked - earlier) > _CHANGED).any(axis=0), np.full(len(motion.v), motion.dt), self._since)
        self._asked, self._since = (float(asked[0, -1]), float(asked[1, -1])), float(ages[-1] + motion.dt)
        return np.asarray(ages + motion.dt / 2)

    def since_rest(self, motion: Motion) -> FloatArray:
        """Return the time since the chair last rested, in the middle of each step, 0 while it does [s]."""
        ages = _since(~motion.moving, np.full(len(motion.v), motion.dt), self._moved)
        self._moved = float(ages[-1] + motion.dt)
        return np.asarray(np.where(motion.moving, ages - motion.dt / 2, 0.0))

    def since_reversal(self, motion: Motion) -> FloatArray:
        """Return the distance since the driving direction changed, in the middle of each step [m]."""
        signs = np.sign(motion.v)
        index = np.maximum.accumulate(np.where(signs != 0, np.arange(1, len(signs) + 1), 0))
        direction = np.concatenate([[self._direction], signs])[index]
        earlier = np.concatenate([[self._direction], direction[:-1]])
        way = np.abs(motion.v) * motion.dt
        gone = _since((direction != earlier) & (earlier != 0), way, self._travel)
        self._direction, self._travel = float(direction[-1]), float(gone[-1] + way[-1])
        return np.asarray(gone + way / 2)

    def change(self, rate: FloatArray, dt: float) -> FloatArray:
        """Return the mean change of a rate in each step [1/s of its unit]."""
        return np.asarray((rate - self._followed.follow(rate, dt, _FOLLOWS)) / _FOLLOWS)

    def wheel(self, motion: Motion, side: int) -> FloatArray:
        """Return the speed of the left (side -1) or right (side 1) wheel [m/s]; the constant is the track."""
        return np.asarray(motion.v + side * motion.w * self.constant / 2)


def asked_for(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the rates that the inputs stand for, before any effect: v [m/s], w [rad/s], (n,)."""
    return motion.known.get("v_asked", motion.v), motion.known.get("w_asked", motion.w)


COVARIATES: Mapping[str, Callable[[Follower, Motion], FloatArray]] = {
    "v": lambda _, motion: motion.v,
    "abs_v": lambda _, motion: np.abs(motion.v),
    "w": lambda _, motion: motion.w,
    "abs_w": lambda _, motion: np.abs(motion.w),
    "v_times_w": lambda _, motion: motion.v * motion.w,
    "acceleration": lambda self, motion: self.change(motion.v, motion.dt),
    "yaw_acceleration": lambda self, motion: self.change(motion.w, motion.dt),
    "wheel_left": lambda self, motion: self.wheel(motion, -1),
    "wheel_right": lambda self, motion: self.wheel(motion, 1),
    "time": Follower.time,
    "since_command": Follower.since_command,
    "since_rest": Follower.since_rest,
    "since_reversal": Follower.since_reversal,
    "heading": Follower.heading,
    "distance": Follower.distance,
    "x": lambda self, motion: self.place(motion, 0),
    "y": lambda self, motion: self.place(motion, 1),
    MOVING: lambda _, motion: np.ones_like(motion.v),
}


def _since(begins: BoolArray, grows: FloatArray, before: float) -> FloatArray:
    """Return what has grown since the condition last held, at the beginning of each step; before: at the first."""
    gone = np.concatenate([[0.0], np.cumsum(grows)[:-1]])
    last = np.maximum.accumulate(np.where(begins, np.arange(len(gone)), -1))
    return np.where(last >= 0, gone - gone[np.maximum(last, 0)], before + gone)
