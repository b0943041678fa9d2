# SPDX-License-Identifier: BSD-3-Clause
"""The robot, its laser, its room and the reference of a case, and the drives there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kurumaisu.bench.strangers.marl.causes import VOLTS, Cause
from kurumaisu.bench.strangers.marl.driving import Drive, Driver, measure, time_scans
from kurumaisu.bench.strangers.marl.rates import Covariates
from kurumaisu.bench.strangers.marl.rooms import draw_room
from kurumaisu.bench.strangers.marl.things import LASERS, REFERENCES, ROBOTS, Laser, Noise, Rng, Robot


def _robot(rng: Rng, chair: bool) -> Robot:
    if chair:
        return Robot("MD-100", rng.uniform(0.6, 1.0), rng.uniform(0.6, 1.1), 0.42, 0.5, True)
    return ROBOTS[rng.integers(len(ROBOTS))]


def _covariates(rng: Rng, i: int, start: float) -> Covariates:
    p = rng.uniform(0, 6, 6)
    a, b, c = rng.uniform(3, 8), rng.uniform(8, 18), rng.uniform(0.15, 0.4)
    return {
        "temperature": lambda t: 20 + 3 * np.sin(i + p[3]) + a * np.sin((t + start) / 90 + p[0]),
        "humidity": lambda t: 50 + b * np.sin(t / 17 + p[1]) + 5 * np.sin(t / 41 + p[2]),
        "tyre": lambda t: 2.0 + c * np.sin(t / 29 + p[4]) + 0.02 * np.sin(t / 5),
        "battery": lambda t: 25.0 - 0.0004 * (t + start) + 0.02 * np.sin(t / 11 + p[5]),
    }


class Setting:
    """A robot with its laser in its room, and what all drives share."""

    def __init__(self, rng: Rng, causes: list[Cause], limit: str, kind: str) -> None:
        ids = {c.id for c in causes}
        chair = bool(ids & VOLTS) or rng.random() < 0.3
        self.robot = r = _robot(rng, chair)
        eyes = any((c.channel or c.id).startswith(("laser.", "world.")) for c in causes) or kind == "wrong"
        eyes = eyes or (rng.random() < 0.6 and "base.clock_scale" not in ids)
        sort = LASERS[0] if chair and rng.random() < 0.7 else LASERS[rng.integers(len(LASERS))]
        self.laser = Laser(rng, sort, r.radius) if eyes else None
        self.limit = limit
        self.room = draw_room(rng, self.reach, r.radius)
        if limit:
            self.room = draw_room(rng, 30, 0.5)
        self.every = rng.uniform(0.7, 1.2) * max(1, sort.beams / 300)  # between scans
        self.ref = REFERENCES[rng.integers(3)]
        k = np.exp(rng.uniform(-0.3, 0.3, 2))
        self.noise = Noise(0.015 * r.v * k[0], 0.018 * r.w * k[1], rng.uniform(0.15, 0.8))
        self.style = str(rng.choice(["auto", "joy"]))
        self.tails = float(rng.choice([0.0, 0.0, 0.002]))
        self.columns = rng.random() < 0.5
        self.switched_on = rng.uniform(0, 60)
        self.wrapped = rng.random() < 0.6
        self.epoch = round(1.6e9 + rng.uniform(0, 1.5e8)) if rng.random() < 0.5 else 0
        self.voltage = chair and (bool(ids & VOLTS) or rng.random() < 0.6)
        self.law = "published" if "base.steering_law" in ids else "corrected"

    @property
    def reach(self) -> float:
        """Return how far it sees."""
        return self.laser.far if self.laser else 8.0

    def drives(self, rng: Rng, causes: list[Cause], only: int | None = None) -> list[Drive] | None:
        """Return three or four drives; None where one of them hits something again and again."""
        out, start = list[Drive](), self.switched_on
        for i in range(only or int(rng.integers(3, 5))):
            covariates, duration = _covariates(rng, i, start), rng.uniform(90, 160)
            for _ in range(6):
                d = Drive(rng, i, self.robot, self.noise, start, duration)
                d.covariates, d.laser = covariates, self.laser
                if Driver(rng, d, self.room, self.style, self.limit).drive(causes):
                    break
            else:
                return None
            measure(rng, d, self.ref, causes)
            if self.laser:
                time_scans(rng, d, self.every)
            start += duration + rng.uniform(20, 200)
            out.append(d)
        for d in out[:-1]:
            d.tails = self.tails
        return out


class Case(NamedTuple):
    """A case before it is written; shown: how sure each cause is, and how sure beside what else might be."""

    kind: str
    setting: Setting
    causes: list[Cause]
    drives: list[Drive]
    shown: list[tuple[float, float]]
