# SPDX-License-Identifier: BSD-3-Clause
"""Clearpath Warthog: gain, lag and delay from command to wheel."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu.real import warthog
from kurumaisu.real.by_hand import step_response
from kurumaisu.real.criticise import criticise, recording
from kurumaisu.types import FloatArray

# [s] in which commands count, and the wheels follow; 298-302 s they count, too, but the wheels rest.
FOLLOWED = {"spin_1": (334.7, 338.55), "spin_2": (385.0, 388.9), "steps": (405.4, 429.75)}


def run(data: Path, output: Path) -> None:
    """Print what the wheels make of commands, by hand and by the critic."""
    log = warthog.load(data)
    print("## By hand: command to wheel (first-order lag behind a delay, grid search)")
    radius, track, _ = warthog.wheels_against_ground(log, 134.0, 218.0)
    wheels = warthog.odometry(log, radius, track)
    for start, end in (FOLLOWED["steps"], (411.6, 423.7), *list(FOLLOWED.values())[:2]):
        part = (log.t >= start) & (log.t <= end)
        for name, asked, seen in (("v", log.v, wheels[:, 4]), ("w", log.w, wheels[:, 5])):
            gain, tau, delay, rms = step_response(log.t[part], asked[part], seen[part])
            print(f"{start:g}-{end:g} s, {name}: gain {gain:.3f}, lag {tau:.2f} s, delay {delay:.2f} s, rms {rms:.3f}")
    criticise(_command(log, wheels, output / "command"), output / "command", "command against the wheels")


def _command(log: warthog.Log, wheels: FloatArray, folder: Path) -> Path:
    """Write commands and what the wheels say of the motion, of every time that the robot followed for a while."""
    command = np.column_stack([log.t, log.v, log.w])
    return recording(
        folder,
        {
            name: {"command": warthog.between(command, *span), "pose": warthog.between(wheels[:, :4], *span)}
            for name, span in FOLLOWED.items()
        },
    )
