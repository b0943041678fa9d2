# SPDX-License-Identifier: BSD-3-Clause
"""SENA, a robotic wheelchair of the University of Malaga: odometry and a SICK, and no other reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.reading import read_recording
from kurumaisu.real.asking import ask, there
from kurumaisu.real.by_hand import range_flow, robust

FOLDER = Path("/usr/share/mrpt/datasets")
LOG = "2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog"
_ROWS = 8  # scans, 2 s: stretches over which odometry and scans are compared


def run(data: Path, output: Path, log: str = LOG) -> None:
    """Print what can be said of a rawlog of MRPT's own; data is not needed."""
    path = there(FOLDER / log)
    recording = read_recording(path)
    drive, laser = recording.runs[0], recording.laser
    assert drive.scan is not None
    assert drive.odom is not None
    assert laser is not None
    steps = geometry.between(drive.odom.values[:-1, :3], drive.odom.values[1:, :3])
    print("## By hand")
    print(
        f"{len(drive.scan.t)} scans in {drive.scan.t[-1] - drive.scan.t[0]:.1f} s, "
        f"{np.hypot(*steps[:, :2].T).sum():.1f} m, {np.degrees(np.abs(steps[:, 2]).sum()):.0f} deg of turns, "
        f"fastest {np.abs(drive.odom.column('v')).max():.2f} m/s"
    )
    angles = laser.angle_min + laser.angle_increment * np.arange(laser.beams)
    seen = range_flow(np.where(np.isfinite(drive.scan.values), drive.scan.values, np.nan), angles, laser.x)
    print(f"range flow found a motion for {np.isfinite(seen[:, 0]).sum()} of {len(seen)} pairs of scans")
    count = len(seen) // _ROWS
    whole = np.isfinite(seen[: count * _ROWS, 0]).reshape(count, _ROWS).all(1)
    if whole.sum() > 5:
        for name, i, column in (("way ahead", 0, 0), ("turn", 1, 2)):
            asked = steps[: count * _ROWS, column].reshape(count, _ROWS).sum(1)[whole]
            got = seen[: count * _ROWS, i].reshape(count, _ROWS).sum(1)[whole]
            rng = np.random.default_rng(1)
            drawn = [rng.integers(0, whole.sum(), whole.sum()) for _ in range(200)]
            sd = float(np.std([robust(asked[k, None], got[k])[0] for k in drawn]))
            factor = robust(asked[:, None], got)[0]
            print(f"{name}, scans over odometry: {factor:.3f} +- {sd:.3f} ({whole.sum()} stretches)")
    ask(path, output, "odometry against its own scans")
