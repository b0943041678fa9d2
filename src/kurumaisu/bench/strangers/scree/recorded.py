# SPDX-License-Identifier: BSD-3-Clause
"""A whole recording as its owner has it, and how it is taken."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.scree.basics import STEP, Array, Column, Mask, Path, Rng, Rows
from kurumaisu.bench.strangers.scree.driving import Manner, drive_through
from kurumaisu.bench.strangers.scree.plant import Causes, Drive
from kurumaisu.bench.strangers.scree.ranges import Site, look
from kurumaisu.bench.strangers.scree.reference import Poses, Reference, measure
from kurumaisu.bench.strangers.scree.robots import Robot
from kurumaisu.bench.strangers.scree.rooms import Room
from kurumaisu.bench.strangers.scree.scatter import read


@dataclass(frozen=True)
class Setup:
    """Who drives what where, and what measures it."""

    robot: Robot
    room: Room
    reference: Reference
    site: Site | None
    manner: Manner
    columns: tuple[Column, ...]
    noted: bool


@dataclass(frozen=True)
class Scans:
    """Stamps of scans and their readings."""

    t: Array
    r: Array

    def keep(self, mask: Mask) -> Scans:
        """Some of the scans."""
        return Scans(self.t[mask], self.r[mask])


@dataclass(frozen=True)
class Taken:
    """A drive and what was recorded of it; `asked` are its queries."""

    drive: Drive
    poses: Poses
    scans: Scans | None
    asked: Array


def draw_columns(rng: Rng) -> tuple[Column, ...]:
    """A temperature, a humidity, and the pressure of the tyres."""
    out = []
    for name, middle, swing, slope in (
        ("temperature", 22.0, 3.0, 0.001),
        ("humidity", 45.0, 9.0, 0.0),
        ("tyre_pressure", 2.3, 0.12, -0.00002),
    ):
        period, phase = rng.uniform(70, 190), rng.uniform(0, 6.28)
        out.append(Column(name, middle + swing * rng.normal(), swing * rng.uniform(0.8, 1.3), period, phase, slope))
    return tuple(out)


def draw_drives(setup: Setup, causes: Causes, rng: Rng) -> tuple[Drive, ...]:
    """Three or four drives, one after the other."""
    start, out = float(rng.uniform(15, 60)), []
    none = np.zeros(0)
    for k in range(int(rng.integers(3, 5))):
        n = int(rng.uniform(95, 175) / STEP)
        path = Path(*(np.zeros(n + 1) for _ in range(3)))
        name = f"run_{k + 1}"
        empty = Drive(name, round(start, 2), Rows(none, none, none), path, setup.robot, setup.columns)
        out.append(drive_through(setup.room, empty, causes, setup.manner, rng))
        start += n * STEP + rng.uniform(20, 90)
    return tuple(out)


def scan_stamps(setup: Setup, drive: Drive, rng: Rng) -> Array:
    """When scans begin: thinned to a size that is easily kept, a little uneven, some lost."""
    if setup.site is None:
        return np.zeros(0)
    laser = setup.site.laser
    step = max(0.35, laser.beams * 500 / 250000)
    step = laser.turn * np.ceil(step / laser.turn)
    t = np.arange(0.5, drive.length - 0.8, step)
    t = t + rng.uniform(0, 0.004, len(t))
    return np.asarray(np.round(t[rng.random(len(t)) > 0.01], 6))


def take(setup: Setup, causes: Causes, drive: Drive, stamps: Array, rng: Rng) -> Taken:
    """Record a drive."""
    poses = measure(drive, causes, setup.reference, rng)
    scans = None
    if setup.site is not None:
        h = look(setup.site, causes, drive, stamps, drive.path.at(stamps))
        scans = Scans(stamps, read(setup.site, causes, h, rng))
    return Taken(drive, poses, scans, np.zeros((0, 2)))


def _motion_queries(poses: Poses, rng: Rng) -> Array:
    t = poses.t
    out: list[tuple[float, float]] = []
    at = float(t[0]) + 6.0
    while at < t[-1] - 4 and len(out) < 28:
        i = int(np.searchsorted(t, at))
        j = int(np.searchsorted(t, t[min(i, len(t) - 1)] + rng.uniform(1.7, 2.3)))
        if j < len(t) and poses.good[i] and poses.good[j] and t[j] - t[i] < 2.7:
            out.append((float(t[i]), float(t[j])))
        at += rng.uniform(3.6, 6.0)
    return np.array(out).reshape(-1, 2)


def withhold(taken: Taken, rng: Rng) -> tuple[Taken, Taken]:
    """Ask queries of the test drive: with everything, and with what they ask for taken out."""
    t = taken.poses.t
    q = _motion_queries(taken.poses, rng)
    inside = np.zeros(len(t), dtype=bool)
    for a, b in q:
        inside |= (t > a) & (t <= b)
    scans, ask = taken.scans, q
    if scans is not None:
        free = np.array([np.all((s < q[:, 0] - 0.3) | (s > q[:, 1] + 0.3)) for s in scans.t])
        good = t[~inside & taken.poses.good]
        k = np.clip(np.searchsorted(good, scans.t), 1, len(good) - 1)
        free &= (good[k] - good[k - 1] < 0.3) & (scans.t > 4.0)
        chosen = np.sort(rng.permutation(np.flatnonzero(free))[:9])
        ask = np.concatenate([q, np.stack([scans.t[chosen]] * 2, axis=-1)])
        ask = ask[np.argsort(ask[:, 0], kind="stable")]
        scans = scans.keep(~np.isin(np.arange(len(scans.t)), chosen))
    full = replace(taken, asked=ask)
    return full, Taken(taken.drive, taken.poses.keep(~inside), scans, ask)
