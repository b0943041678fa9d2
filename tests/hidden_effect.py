# SPDX-License-Identifier: BSD-3-Clause
"""Recordings with a hidden effect, made by code that shares nothing with the effects of the package.

Own voltage law (typed from the paper), own integrator (midpoint rule at 1 ms), own forms of the effects: a lag is a
differential equation, a delay is a queue, a dead zone is in volts beyond the threshold, noise is Euler-Maruyama.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.sim.chair.joystick import joystick
from kurumaisu.types import FloatArray

# id: from, to, of either sign
EFFECTS: dict[str, tuple[float, float, bool]] = {
    "base.gain_v": (0.08, 0.15, True),
    "base.gain_w": (0.10, 0.20, True),
    "base.left_right_gain": (0.08, 0.16, True),
    "base.veer": (0.06, 0.15, True),
    "base.dead_zone_v": (0.06, 0.12, False),
    "base.dead_zone_w": (0.04, 0.08, False),
    "base.delay": (0.10, 0.25, False),
    "base.lag_v": (0.20, 0.40, False),
    "base.lag_w": (0.20, 0.40, False),
}
_STEP = 0.001  # [s]
_POSE_EVERY = 100  # steps


@dataclass(frozen=True)
class Disturbance:
    """Ornstein-Uhlenbeck noise of the rates: sd_v [m/s], sd_w [rad/s], tau [s]; pose_sd [m, rad] of the reference.

    at_rest: the noise acts on a chair that is asked to rest, too.
    """

    sd_v: float
    sd_w: float
    tau: float
    pose_sd: float
    at_rest: bool = False


USUAL = Disturbance(sd_v=0.01, sd_w=0.02, tau=0.3, pose_sd=0.005)
RUNS = 3

_Line = tuple[float, float]  # slope, intercept
_FORWARD: tuple[_Line, _Line] = ((1.32402, 0.127906), (2.07369, -0.108783))
_STEER: tuple[_Line, _Line] = ((-0.499211, 0.104181), (-0.469278, -0.169476))


def draw_size(effect: str, rng: np.random.Generator) -> float:
    """Return a size of the effect in its own unit."""
    low, high, signed = EFFECTS[effect]
    return float(rng.uniform(low, high) * (rng.choice([-1, 1]) if signed else 1))


def recording(
    effect: str | None, size: float, seed: int, seconds: float, disturbance: Disturbance = USUAL
) -> Recording:
    """Return a recording of several runs with a hidden effect, or none."""
    seeds = range(seed * RUNS, (seed + 1) * RUNS)
    return recording_of(f"hidden {seed}", [make_run(effect, size, each, seconds, disturbance) for each in seeds])


def recording_of(name: str, drives: Sequence[dict[str, FloatArray]]) -> Recording:
    """Return a recording of the tables of some drives."""
    runs = tuple(
        Run(
            f"run_{i}",
            command=Series.of_table(tables["command"], "v", "w"),
            voltage=Series.of_table(tables["voltage"], "v_f", "v_s"),
            pose=Series.of_table(tables["pose"], "x", "y", "theta"),
        )
        for i, tables in enumerate(drives, start=1)
    )
    return Recording(name, runs, train=tuple(run.name for run in runs))


def make_run(
    effect: str | None, size: float, seed: int, seconds: float, disturbance: Disturbance
) -> dict[str, FloatArray]:
    """Return one drive as tables: command (t, v, w), voltage (t, v_f, v_s), pose (t, x, y, theta) at 10 Hz."""
    rng = np.random.default_rng(seed)
    return drive(joystick(seconds, rng), effect, size, rng, disturbance)


def drive(
    command: FloatArray, effect: str | None, size: float, rng: np.random.Generator, disturbance: Disturbance
) -> dict[str, FloatArray]:
    """Return the tables of a drive whose commands (n, 3) of t, v, w are given; the last one is rest."""
    voltage = np.array([[t, _volts(v, _FORWARD), _volts(w, _STEER)] for t, v, w in command])
    steps = round((command[-1, 0] + 1.0) / _STEP)
    asked = command[np.searchsorted(command[:, 0], np.arange(steps) * _STEP, side="right") - 1, 1:]
    noise = _ornstein_uhlenbeck(steps, rng, disturbance)
    rates = np.column_stack([asked, noise]).tolist()  # Python's own floats: the same sums in a third of the time
    chair = _Chair(effect, size, disturbance.at_rest)
    poses = []
    for k, each in enumerate(rates):
        if k % _POSE_EVERY == 0:
            error = rng.standard_normal(3) * disturbance.pose_sd
            poses.append([k * _STEP, *(np.array([chair.x, chair.y, chair.theta]) + error)])
        chair.step(*each)
    return {"command": command, "voltage": voltage, "pose": np.array(poses)}


def _ornstein_uhlenbeck(steps: int, rng: np.random.Generator, like: Disturbance) -> FloatArray:
    kick = np.sqrt(2 * _STEP / like.tau) * np.array([like.sd_v, like.sd_w]) * rng.standard_normal((steps, 2))
    kept, v, w = 1 - _STEP / like.tau, 0.0, 0.0
    out = [(v, w)]
    for kick_v, kick_w in kick[1:].tolist():
        v, w = v * kept + kick_v, w * kept + kick_w
        out.append((v, w))
    return np.array(out)


def _volts(rate: float, lines: tuple[_Line, _Line]) -> float:
    if rate == 0:
        return 0.0
    slope, intercept = lines[int(rate < 0)]
    return slope * rate + intercept


class _Chair:
    """A chair with one peculiarity."""

    def __init__(self, effect: str | None, size: float, restless: bool) -> None:
        self.x = self.y = self.theta = 0.0
        self._effect, self._size, self._restless = effect, size, restless
        self._v = self._w = 0.0
        self._queue = deque([(0.0, 0.0)] * (round(size / _STEP) if effect == "base.delay" else 0))

    def step(self, v: float, w: float, noise_v: float, noise_w: float) -> None:
        """Drive one step towards the rates asked for; noise acts on a chair that moves, or always."""
        self._queue.append((v, w))
        v, w = self._steady(*self._queue.popleft())
        moving = v != 0 or w != 0 or self._restless
        share = _STEP / self._size if self._effect in ("base.lag_v", "base.lag_w") else 0.0
        self._v = self._v + share * (v - self._v) if self._effect == "base.lag_v" else v
        self._w = self._w + share * (w - self._w) if self._effect == "base.lag_w" else w
        forward, turn = self._v + moving * noise_v, self._w + moving * noise_w
        self.x += _STEP * forward * math.cos(self.theta + 0.5 * _STEP * turn)
        self.y += _STEP * forward * math.sin(self.theta + 0.5 * _STEP * turn)
        self.theta += _STEP * turn

    def _steady(self, v: float, w: float) -> tuple[float, float]:
        size = self._size
        changed = {
            "base.gain_v": lambda: (v + size * v, w),
            "base.gain_w": lambda: (v, w + size * w),
            "base.left_right_gain": lambda: (v, w + size * abs(w)),
            "base.veer": lambda: (v, w + size * v),
            "base.dead_zone_v": lambda: (_swallowed(v, size, _FORWARD), w),
            "base.dead_zone_w": lambda: (v, _swallowed(w, size, _STEER)),
        }
        return changed[self._effect]() if self._effect in changed else (v, w)


def _swallowed(rate: float, width: float, lines: tuple[_Line, _Line]) -> float:
    """Return the rate left when the controller subtracts a width [V] from the volts beyond the branch's threshold."""
    if rate == 0:
        return 0.0
    slope = abs(lines[int(rate < 0)][0])
    return float(np.sign(rate) * max(slope * abs(rate) - width, 0.0) / slope)
