# SPDX-License-Identifier: BSD-3-Clause
"""The 59 mm of equation (4): a datum of the experiment, taped from the housing's front, or a property of the sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu._core import LaserError
from kurumaisu.critic.values.recording import Recording
from kurumaisu.params import Model
from kurumaisu.riddles import lab

OFFSET = 0.058826  # [m] paper, equation (4)
_AHEAD = np.radians(5.0)  # bearings of the beams that a mean reading at a distance is taken from
_OPEN = frozenset({"laser.offset", "laser.mount_x", "world.map_error"})


@dataclass(frozen=True)
class _Truth:
    name: str
    chair: Model


def tell(seed: int) -> Iterator[str]:
    """Yield the riddle, line by line."""
    yield "equation (4): readings are 59 mm too long. Is it where the tape began, or the sensor?"
    plain = lab.with_laser(lab.chair(), error=_error(0.0))  # what is criticised: no offset
    mount = plain.laser.mount
    truths = (
        _Truth("datum: sensor 59 mm further back", lab.with_laser(plain, mount=replace(mount, x=mount.x - OFFSET))),
        _Truth("sensor: it reads 59 mm too long", lab.with_laser(plain, error=_error(OFFSET))),
    )
    yield ""
    yield f"mean reading over taped distance, middle beam, {lab.SCANS} scans each (least squares):"
    for truth in truths:
        recording = lab.measured(truth.chair, "wall_five_distances", plain.laser, seed)
        yield f"  {truth.name:34s} {_line(recording, plain)}"
    yield ""
    yield "the critic, from those middle beams alone, asked between the three that the paper leaves open:"
    for truth in truths:
        recording = lab.measured(truth.chair, "wall_five_distances", plain.laser, seed)
        yield f"  {truth.name:34s} {lab.laser_answer(lab.middle(recording, _AHEAD), plain, _OPEN).told()}"
    for script in ("wall_five_distances", "room_poses"):
        yield ""
        yield f"the critic, from {script}, all beams:"
        for truth in truths:
            found = lab.laser_answer(lab.measured(truth.chair, script, plain.laser, seed), plain)
            yield f"  {truth.name:34s} {found.told()}"


def _error(offset: float) -> LaserError:
    """Return equation (4) with another datum offset."""
    return LaserError(
        scale=1.004587,
        datum_offset=offset,
        sigma=(0.002334, -0.000488, 0.000199),
        resolution=0.001,
        range_min=0.06,
        range_max=4.0,
    )


def _line(recording: Recording, nominal: Model) -> str:
    """Return slope and offset of the middle beam's mean over the distance from where the sensor is believed to be."""
    ahead = round(-nominal.laser.angle_min / nominal.laser.angle_increment)
    taped, read = [], []
    for run in recording.runs:
        assert run.pose is not None
        assert run.scan is not None
        taped.append(lab.WALL - float(np.mean(run.pose.values[:, 0])) - nominal.laser.mount.x)
        read.append(float(np.nanmean(run.scan.values[:, ahead])))
    slope, offset = np.polyfit(taped, read, 1)
    return f"{slope:.4f} r {1e3 * offset:+.1f} mm"
