# SPDX-License-Identifier: BSD-3-Clause
"""Where a laser is and when: stops in a room, stops before one wall, and drives through a room."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kurumaisu.bench.hidden.generator.motion import STEP, Setting, drive, integrate
from kurumaisu.bench.hidden.generator.noise import Regime, draw_rates
from kurumaisu.bench.hidden.generator.rooms import Room, draw_room, one_wall
from kurumaisu.types import FloatArray, IntArray

SCAN_TIME = 0.1  # [s]
REFERENCE_TIME = 0.05  # [s] between poses of the reference in a drive; a scan is stamped with one of them
_SETTLED = 20.0  # [s] that the laser has stood at a stop before its first scan
_HALF = (1.3, 0.8)  # [m] of the part of a room in which the chair drives


@dataclass(frozen=True)
class Leg:
    """One run: stamps (s,) of scans; stop (s,) that each belongs to; path (n, 3) in steps of STEP from 0 s.

    Where the chair was carried, path has one pose per stop, and since [s] says when each was taken up.

    reference: times (m,) and errors (m, 3) of its poses; setting: the drive, None where the chair was carried.
    """

    stamps: FloatArray
    stop: IntArray
    path: FloatArray = field(repr=False)
    times: FloatArray = field(repr=False)
    errors: FloatArray = field(repr=False)
    setting: Setting | None = None
    since: FloatArray | None = None

    def poses(self, times: FloatArray) -> FloatArray:
        """Return base_link's poses at times of any shape, (..., 3)."""
        if self.since is not None:
            return np.asarray(self.path[np.maximum(np.searchsorted(self.since, times) - 1, 0)])
        at = np.clip(times / STEP, 0, len(self.path) - 1.001)
        low = at.astype(int)
        part = (at - low)[..., None]
        return np.asarray((1 - part) * self.path[low] + part * self.path[low + 1])


@dataclass(frozen=True)
class Tour:
    """Legs through a room; truth: sd of the reference's position [m] and heading [rad]; moving: scans are taken so."""

    room: Room
    legs: tuple[Leg, ...]
    truth: tuple[float, float]
    moving: bool


def draw_tour(design: str, regime: Regime, rng: np.random.Generator) -> Tour:
    """Return a tour: 'room', 'wall' or 'drive'."""
    truth = (regime.position_sd, regime.heading_sd)
    if design == "drive":
        room = draw_room(rng)
        return Tour(room, tuple(_driven(regime, rng) for _ in range(2)), truth, moving=True)
    if design == "wall":
        distances = np.array([0.35, 0.6, 1.0, 2.0, 3.3])
        poses = np.column_stack([-0.3 - distances, rng.uniform(-0.2, 0.2, 5), np.zeros(5)])
        return Tour(one_wall(rng), (_stops(poses, 0.0, 50, truth, rng),), truth, moving=False)
    room = draw_room(rng)
    legs: list[Leg] = []
    start, first = 0.0, None
    for run in range(3):
        turned = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.uniform(-2.2, 2.2, 4))  # less than the reader doubts
        poses = np.column_stack([rng.uniform(-1.5, 1.5, 4), rng.uniform(-1.0, 1.0, 4), turned])
        first = poses[0] if first is None else first
        poses[-1] = first if run == 2 else poses[-1]
        poses[:, 2] = np.unwrap(poses[:, 2])
        legs.append(_stops(poses, start, 20, truth, rng))
        start = float(legs[-1].stamps[-1]) + rng.uniform(60, 200)
    return Tour(room, tuple(legs), truth, moving=False)


def _stops(poses: FloatArray, start: float, scans: int, truth: tuple[float, float], rng: np.random.Generator) -> Leg:
    """Return a leg that stands at each pose for some scans, minutes apart; each pose was measured once."""
    count = len(poses)
    begins = start + np.concatenate([[0.0], np.cumsum(rng.uniform(60, 150, count - 1))])
    stamps = np.round((begins[:, None] + SCAN_TIME * np.arange(scans)).ravel(), 6)
    stop = np.repeat(np.arange(count), scans)
    sd = np.array([truth[0], truth[0], truth[1]])
    errors = (rng.standard_normal((count, 3)) * sd)[stop] + 0.1 * rng.standard_normal((len(stop), 3)) * sd
    return Leg(stamps, stop, poses, stamps, errors, since=begins - _SETTLED)


def _driven(regime: Regime, rng: np.random.Generator, seconds: float = 30.0) -> Leg:
    start = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-np.pi, np.pi)])
    command = _wander(seconds, start, rng)
    noise = draw_rates(regime, round((seconds + 3.0) / STEP), rng)
    times = np.round(np.arange(0.0, seconds + 1.0, REFERENCE_TIME), 6)
    setting = Setting(command, start, times, noise)
    path = integrate(drive(setting, ())[1])
    stamps = np.round(0.2 + SCAN_TIME * np.arange(round((seconds - 0.4) / SCAN_TIME)), 6)
    errors = rng.standard_normal((len(times), 3)) * [regime.position_sd, regime.position_sd, regime.heading_sd]
    return Leg(stamps, np.arange(len(stamps)), path, times, errors, setting)


def _wander(seconds: float, start: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return commands (n, 3) that keep the chair in the middle of the room; spins both ways where nothing else does."""
    rows, t, pose = [], 0.0, start
    while t < seconds:
        hold = round(rng.uniform(0.8, 2.0), 3)
        for attempt in range(30):
            spin = attempt >= 20 or rng.random() < 0.3
            v = 0.0 if spin else rng.uniform(0.15, 0.6) * rng.choice([-1.0, 1.0])
            w = rng.uniform(0.2, 0.8) * rng.choice([-1.0, 1.0]) if spin or rng.random() < 0.6 else 0.0
            heading = pose[2] + w * hold / 2
            reach = v * hold * np.sinc(w * hold / 2 / np.pi)
            after = pose + np.array([reach * np.cos(heading), reach * np.sin(heading), w * hold])
            if abs(after[0]) < _HALF[0] and abs(after[1]) < _HALF[1]:
                break
        rows.append((t, v, w))
        t, pose = round(t + hold, 3), after
    rows.append((max(t, seconds), 0.0, 0.0))
    return np.array([row for row in rows if row[0] < seconds] + [(seconds, 0.0, 0.0)])
