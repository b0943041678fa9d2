# SPDX-License-Identifier: BSD-3-Clause
"""A drive in phases, whose reference is then spoilt: of a chair that follows to the letter, or has a dead zone."""

from collections.abc import Sequence

import numpy as np

from kurumaisu.critic.values.recording import Recording, Run, Series

PHASE = 5.0  # [s]
RATES = ((0.4, 0.0), (0.4, 0.4), (0.0, 0.5), (0.0, 0.0), (-0.3, 0.3), (0.5, -0.4), (0.0, -0.5), (0.3, 0.1))  # v, w
PHASES = 12
_STEP = 0.01  # [s]


def phased(
    rng: np.random.Generator,
    rates: Sequence[tuple[float, float]] = RATES,
    *,
    rate: float = 20.0,
    noise: float = 0.002,
    zone: float = 0.0,
    held: tuple[float, float] | None = None,
    start: float = 0.0,
) -> Run:
    """Return a run of a minute; rates by turns, each off by a tenth; zone [m/s, rad/s] that is swallowed.

    rate [1/s] and noise [m, rad] of the reference; held [s] after the start: the chair stands; start [s] by the clock.
    """
    asked = np.array([rates[i % len(rates)] for i in range(PHASES)]) * rng.uniform(0.9, 1.1, (PHASES, 1))
    t = np.arange(0.0, PHASE * PHASES, _STEP)
    driven = asked[(t / PHASE).astype(int)]
    driven = np.sign(driven) * np.maximum(np.abs(driven) - zone, 0.0)
    if held is not None:
        driven[(t >= held[0]) & (t < held[1])] = 0.0
    v, w = driven.T
    theta = _STEP * np.cumsum(w)
    middle = theta - _STEP * w / 2
    poses = np.column_stack([_STEP * np.cumsum(v * np.cos(middle)), _STEP * np.cumsum(v * np.sin(middle)), theta])
    every = round(1 / (rate * _STEP))
    poses = poses[::every] + noise * rng.standard_normal((len(t[::every]), 3))
    return Run(
        "run_1",
        command=Series(start + PHASE * np.arange(PHASES), asked, ("v", "w")),
        pose=Series(start + t[::every] + _STEP, poses, ("x", "y", "theta")),
    )


def recorded(run: Run) -> Recording:
    """Return a recording of this run alone."""
    return Recording("made", (run,), train=(run.name,))
