# SPDX-License-Identifier: BSD-3-Clause
"""Recordings with something hidden that is in no catalogue, by an integrator and laws of their own.

Euler's rule at 5 ms, first-order noise by hand; commands are the rates themselves (a robot without voltages).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from kurumaisu import effects
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.noise.base_noise import Noise, whitened
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import driven_as, load_model, shipped, shipped_robot

STEP = 0.005  # [s]
USUAL = Noise(position_sd=0.005, heading_sd=0.005, sd_v=0.01, sd_lateral=0.003, sd_w=0.02, tau=0.3)
MODEL = driven_as(load_model(shipped("launch/md100.yaml")), shipped_robot("velocity"))
TRACK = MODEL.chassis.track


@dataclass
class State:
    """Of the robot now: rates asked for, pose, time, age of the command, way since reversing, in all, a temperature.

    moved: time since it last rested; gains, veers: what the rates are ahead of where 0.3 s of lag would have them.
    """

    v: float = 0.0
    w: float = 0.0
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    time: float = 0.0
    age: float = 0.0
    moved: float = 1e9
    way: float = 1e9
    gone: float = 0.0
    warmth: float = 20.0
    gains: float = 0.0
    veers: float = 0.0


@dataclass(frozen=True)
class Kind:
    """channel (0 v, 1 lateral, 2 w), covariate as the critic calls it, and the law for drawn numbers a, b in 0..1.

    rests: share of the commands that are rest, besides those by chance.
    """

    channel: int
    covariate: str
    law: Callable[[State, float, float], float]
    rests: float = 0.0

    @property
    def name(self) -> str:
        return ("v", "lateral", "w")[self.channel]


def bump(x: float) -> float:
    return math.exp(-0.5 * x * x)


KINDS = {
    "corrugated floor": Kind(0, "heading", lambda s, a, b: math.sin(3 * s.heading + 6 * a)),
    "side wind": Kind(1, "heading", lambda s, a, b: math.sin(s.heading + 6 * a)),
    "oval wheel": Kind(0, "distance", lambda s, a, b: math.sin(2 * math.pi * s.gone / (0.7 + 0.6 * a))),
    "carpet edge": Kind(2, "x", lambda s, a, b: math.tanh((s.x - 2 * a + 1) / 0.4)),
    "gully": Kind(2, "y", lambda s, a, b: bump((s.y - 2 * a + 1) / (0.4 + 0.4 * b))),
    "overshoot": Kind(0, "since_command", lambda s, a, b: math.exp(-s.age / (0.3 + 0.5 * a))),
    "stiff after a rest": Kind(0, "since_rest", lambda s, a, b: -math.exp(-s.moved / (1.0 + a)), rests=0.3),
    "wobble after reversing": Kind(2, "since_reversal", lambda s, a, b: bump((s.way - 0.8 - 0.5 * a) / 0.3)),
    "warm grease": Kind(0, "temperature", lambda s, a, b: math.tanh((s.warmth - 24 - 4 * a) / 2)),
    "tyre lets go": Kind(2, "time", lambda s, a, b: float(s.time > 20 + 20 * a)),
    "turning costs speed": Kind(0, "abs_w", lambda s, a, b: -max(abs(s.w) - 0.2 - 0.2 * a, 0.0)),
    "pulls aside when it speeds up": Kind(2, "acceleration", lambda s, a, b: math.tanh(s.gains / (0.2 + 0.2 * a))),
    "slow into a turn": Kind(0, "yaw_acceleration", lambda s, a, b: -abs(s.veers)),
    "flutter at one speed": Kind(2, "abs_v", lambda s, a, b: bump((abs(s.v) - 0.3 - 0.2 * a) / 0.08)),
}


@dataclass(frozen=True)
class Case:
    """A recording, its twin without the unknown effect, and the size that was hidden."""

    recording: Recording
    null: Recording
    size: float


def make(kind: Kind, z: float, seed: int, *, seconds: float = 60.0, runs: int = 3, gain_w: float = 0.0) -> Case:
    """Return a case whose hidden effect has the whitened norm z; gain_w: a catalogue effect that acts as well."""
    rng = np.random.default_rng([77, seed])
    a, b, sign = rng.random(), rng.random(), rng.choice([-1, 1])
    plans = [plan(seconds, rng, kind.rests) for _ in range(runs)]
    seeds = rng.integers(2**31, size=runs)

    def recorded(size: float, noise: Noise | None) -> Recording:
        made = [
            drive(p, lambda s: sign * size * kind.law(s, a, b), kind.channel, gain_w, noise, np.random.default_rng(n))
            for p, n in zip(plans, seeds, strict=True)
        ]
        return Recording(f"unknown {seed}", tuple(made), train=tuple(run.name for run in made))

    def named(recording: Recording) -> Recording:
        runs = tuple(
            Run(f"run_{i}", r.command, pose=r.pose, covariates=r.covariates) for i, r in enumerate(recording.runs)
        )
        return Recording(recording.name, runs, train=tuple(run.name for run in runs))

    trial = 0.01
    clean, moved = recorded(0.0, None), recorded(trial, None)
    size = trial * z / norm_between(clean, moved)
    return Case(named(recorded(size, USUAL)), named(recorded(0.0, USUAL)), sign * size)


def problem_of(recording: Recording, ids: frozenset[str] | None = None) -> Problem:
    """Return the problem of a recording whose noise is known; ids: effects that may act beside curves, None: all."""
    drives = [with_covariates(prepare(run, MODEL), run) for run in recording.runs]
    return Problem(drives, MODEL, USUAL, ids=None if ids is None else ids | {effects.SMOOTH})


def norm_between(one: Recording, other: Recording) -> float:
    """Return the whitened norm of the difference between two recordings without noise."""
    squares = 0.0
    for a, b in zip(one.runs, other.runs, strict=True):
        first, second = prepare(a, MODEL), prepare(b, MODEL)
        moved = (second.measured - first.measured).reshape(-1, 1)
        squares += float(np.sum(whitened(first, moved, USUAL)[0] ** 2))
    return float(np.sqrt(squares))


def plan(seconds: float, rng: np.random.Generator, rests: float = 0.0) -> np.ndarray:
    """Return commands (n, 3) of t, v, w, held for 0.8 to 3 s; rests: share of them that are rest for sure."""
    rows, t = [], 0.0
    while t < seconds:
        v = 0.0 if rng.random() < 0.15 else rng.uniform(0.15, 0.7) * (-1 if rng.random() < 0.25 else 1)
        w = 0.0 if rng.random() < 0.25 else rng.uniform(0.1, 0.7) * rng.choice([-1, 1])
        rows.append((t, 0.0, 0.0) if rests and rng.random() < rests else (t, v, w))
        t += rng.uniform(0.8, 3.0)
    return np.array([*rows, (seconds, 0.0, 0.0)])


def drive(commands, extra, channel, gain_w, noise, rng) -> Run:
    """Return the run of these commands; extra(state) is added to a channel while the robot moves."""
    steps = round(commands[-1, 0] / STEP)
    index = np.searchsorted(commands[:, 0], np.arange(steps) * STEP + 1e-9, side="right") - 1
    asked, changed = commands[index, 1:].tolist(), np.diff(index, prepend=-1) != 0
    shaken = disturbances(steps, noise, rng).tolist()
    errors = rng.standard_normal((steps // 20 + 1, 3))
    errors *= 0 if noise is None else [noise.position_sd, noise.position_sd, noise.heading_sd]
    drift = rng.uniform(3, 8) / commands[-1, 0]
    s, last, poses, warmth = State(), 0.0, [], []
    for k in range(steps):
        s.v, s.w, s.time = asked[k][0], asked[k][1] * (1 + gain_w), k * STEP
        s.age = 0.0 if changed[k] else s.age + STEP
        before = asked[max(k - 1, 0)]
        s.gains = (s.gains + s.v - before[0]) * math.exp(-STEP / 0.3)
        s.veers = (s.veers + s.w - before[1] * (1 + gain_w)) * math.exp(-STEP / 0.3)
        s.moved = s.moved + STEP if s.v or s.w else 0.0
        if s.v * last < 0:
            s.way = 0.0
        last = s.v or last
        s.warmth = 21 + drift * s.time + 2 * math.sin(s.time / 9.0)
        if k % 20 == 0:
            poses.append((s.time, s.x, s.y, s.heading))
            warmth.append((s.time, s.warmth))
        rates = [s.v, 0.0, s.w]
        if s.v or s.w:
            rates = [rate + shake for rate, shake in zip(rates, shaken[k], strict=True)]
            rates[channel] += extra(s)
        cos, sin = math.cos(s.heading), math.sin(s.heading)
        s.x += STEP * (rates[0] * cos - rates[1] * sin)
        s.y += STEP * (rates[0] * sin + rates[1] * cos)
        s.heading += STEP * rates[2]
        s.way += STEP * abs(rates[0])
        s.gone += STEP * abs(rates[0])
    table = np.array(poses)
    table[:, 1:] += errors[: len(table)]
    return Run(
        f"run_{rng.integers(10**9)}",
        command=Series.of_table(commands, "v", "w"),
        pose=Series.of_table(table, "x", "y", "theta"),
        covariates={"temperature": Series.of_table(np.array(warmth), "temperature")},
    )


def disturbances(steps: int, noise: Noise | None, rng: np.random.Generator) -> np.ndarray:
    """Return the noise of the rates (steps, 3)."""
    draws = rng.standard_normal((steps, 3))
    if noise is None:
        return draws * 0
    keep = np.exp(-STEP / noise.tau)
    draws[1:] *= np.sqrt(1 - keep**2)
    return lfilter([1.0], [1.0, -keep], draws, axis=0) * [noise.sd_v, noise.sd_lateral, noise.sd_w]
