# SPDX-License-Identifier: BSD-3-Clause
"""The references: motion capture, a total station, scan matching; their stamps, errors, gaps, bursts, bad rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Array, Mask, Rng, wandering
from kurumaisu.bench.strangers.scree.plant import Causes, Drive, seen, stamp


@dataclass(frozen=True)
class Reference:
    """How often and how well poses are measured; a slow wander beside the white error."""

    name: str
    rate: float
    place: float
    heading: float
    wander: float
    tau: float
    unix: float = 0.0


@dataclass(frozen=True)
class Poses:
    """The rows of a drive: stamps, poses, which rows are as good as stated."""

    t: Array
    pose: Array
    good: Mask

    def keep(self, mask: Mask) -> Poses:
        """Some of the rows."""
        return Poses(self.t[mask], self.pose[mask], self.good[mask])

    def at(self, t: Array) -> Array:
        """Poses between rows."""
        good = self.good
        return np.stack([np.interp(t, self.t[good], self.pose[good, k]) for k in range(3)], axis=-1)


REFERENCES = (
    Reference("motion capture", 40.0, 0.0010, 0.0020, 0.0004, 40.0),
    Reference("motion capture from afar", 25.0, 0.0025, 0.0035, 0.0010, 40.0),
    Reference("two prisms and a total station", 8.0, 0.0030, 0.0060, 0.0010, 60.0),
    Reference("scan matching in a good map", 10.0, 0.0060, 0.0045, 0.0030, 25.0),
    Reference("tags on the ceiling", 15.0, 0.0050, 0.0040, 0.0020, 30.0),
)


def draw_reference(rng: Rng) -> Reference:
    """One of the references; Unix times in some recordings."""
    r = REFERENCES[int(rng.integers(len(REFERENCES)))]
    f = rng.uniform(0.8, 1.25, 3)
    unix = float(np.floor(rng.uniform(1.60e9, 1.76e9))) if rng.random() < 0.35 else 0.0
    return replace(r, place=r.place * f[0], heading=r.heading * f[1], wander=r.wander * f[2], unix=unix)


def _stamps(r: Reference, length: float, rng: Rng) -> Array:
    step = rng.normal(1.0, 0.06, int(length * r.rate)).clip(0.5, 1.6) / r.rate
    t = 0.02 + np.cumsum(step)
    t = t[t < length - 0.1]
    keep = rng.random(len(t)) > 0.006
    for _ in range(int(rng.integers(0, 3))):
        at, lasts = rng.uniform(10, length - 10), rng.uniform(0.4, 1.8)
        keep &= (t < at) | (t > at + lasts)
    return np.asarray(np.round(t[keep], 6))


def measure(drive: Drive, causes: Causes, r: Reference, rng: Rng) -> Poses:
    """The rows that the reference writes during a drive."""
    t = _stamps(r, drive.length, rng)
    pose = seen(drive, causes, drive.path.at(t), t)
    n = len(t)
    sd = np.array([r.place, r.place, r.heading])
    error = rng.standard_normal((n, 3)) * sd
    good = np.ones(n, dtype=bool)
    for _ in range(int(rng.integers(0, 3))):
        at = rng.uniform(5, drive.length - 5)
        burst = (t > at) & (t < at + rng.uniform(0.4, 1.2))
        error[burst] *= 2.5
        good &= ~burst
    drift = wandering(rng, t, r.wander, r.tau), wandering(rng, t, r.wander, r.tau)
    pose = pose + error
    pose[:, 0] += drift[0]
    pose[:, 1] += drift[1]
    for k in rng.integers(20, n - 20, int(rng.integers(0, 4))).tolist():
        pose[k, :2] += rng.uniform(0.15, 0.5) * rng.choice([-1.0, 1.0], 2)
        good[k] = False
    shown = np.round(stamp(causes, t), 6)
    return Poses(shown, np.round(pose, 6), good)
