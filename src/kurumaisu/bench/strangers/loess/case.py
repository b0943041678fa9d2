# SPDX-License-Identifier: BSD-3-Clause
"""A case: robot, laser, room, what is hidden, drives; and how its scans and motions are predicted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.loess import plant
from kurumaisu.bench.strangers.loess.driving import Drive, Manner, go
from kurumaisu.bench.strangers.loess.lasers import Laser
from kurumaisu.bench.strangers.loess.pose_effects import refer, unrefer
from kurumaisu.bench.strangers.loess.robots import Robot
from kurumaisu.bench.strangers.loess.rooms import Room
from kurumaisu.bench.strangers.loess.sensing import Scans
from kurumaisu.bench.strangers.loess.values import STEP, Array, Hidden


@dataclass
class Case:
    """All that is drawn before anything is recorded."""

    robot: Robot
    laser: Laser | None
    room: Room
    style: str
    hidden: list[Hidden]
    drives: list[Drive]


def columns_at(drive: Drive, t: Array) -> dict[str, Array]:
    """The extra columns at times since the drive's start."""
    grid = np.arange(len(drive.path)) * STEP
    return {name: np.interp(t, grid, c) for name, c in drive.columns.items()}


def expected(case: Case, drive: Drive, hidden: list[Hidden]) -> Array:
    """The rates of a drive that a list of causes predicts."""
    return plant.motion(case.robot.law, drive.commands, drive.path, drive.columns, hidden)


def true_scans(drive: Drive, t: Array) -> Scans:
    """Scans at stamps, from where the robot really is."""
    return Scans(
        t, drive.clock + t, lambda off: plant.at(drive.path, t + off), plant.at(drive.rates, t), columns_at(drive, t)
    )


def scans_from(case: Case, drive: Drive, t: Array, measured: Array, hidden: list[Hidden]) -> Scans:
    """Scans at stamps, from measured poses and what a list of causes predicts of the motion."""
    caused = expected(case, drive, hidden)
    assumed = plant.integrate(caused, drive.path[0])
    base = unrefer(measured, t, hidden)
    here = plant.at(assumed, t)

    def pose_at(off: Array) -> Array:
        return plant.beyond(base, plant.between(here, plant.at(assumed, t + off)))

    return Scans(t, drive.clock + t, pose_at, plant.at(caused, t), columns_at(drive, t))


def motions(case: Case, drive: Drive, times: tuple[Array, Array], hidden: list[Hidden]) -> Array:
    """Motions between pairs of true times as the reference would measure them."""
    assumed = plant.integrate(expected(case, drive, hidden), drive.path[0])
    start = plant.at(drive.path, times[0])
    step = plant.between(plant.at(assumed, times[0]), plant.at(assumed, times[1]))
    end = plant.beyond(start, step)
    return plant.between(refer(start, times[0], hidden), refer(end, times[1], hidden))


def drive_about(case: Case, hidden: list[Hidden], number: int, rng: np.random.Generator) -> list[Drive]:
    """Drives one after the other, with some seconds between."""
    drives, clock = [], float(rng.uniform(3, 15))
    for _ in range(number):
        for attempt in range(12):
            try:
                drive = go(Manner(case.style, case.room, case.robot), hidden, rng, clock)
                break
            except RuntimeError:
                if attempt == 11:
                    raise
        drives.append(drive)
        clock += len(drive.path) * STEP + float(rng.uniform(15, 45))
    return drives
