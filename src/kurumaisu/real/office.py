# SPDX-License-Identifier: BSD-3-Clause
"""Two simulated drives through an office, whose odometry is that of commands, and a bad one: no real data, a check."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.real.by_hand import least_squares
from kurumaisu.real.criticise import criticise, there

_SPAN = 2.0  # [s]


def run(data: Path, output: Path) -> None:
    """Print what can be said of both drives."""
    for name in ("runA_cmd_rolling", "runB_bad"):
        bag = there(data / f"office/{name}.bag")
        drive = read_recording(bag).runs[0]
        assert drive.pose is not None
        assert drive.odom is not None
        at = np.arange(max(drive.pose.t[0], drive.odom.t[0]), min(drive.pose.t[-1], drive.odom.t[-1]), _SPAN)
        true, said = (geometry.interpolate(part.t, part.values[:, :3], at) for part in (drive.pose, drive.odom))
        moved, asked = geometry.between(true[:-1], true[1:]), geometry.between(said[:-1], said[1:])
        print(f"## By hand: {name}, {len(at)} stretches of {_SPAN:g} s")
        ahead = least_squares(asked[:, [0, 2]], moved[:, 0])
        around = least_squares(asked[:, [2, 0]], moved[:, 2])
        print(f"way ahead over odometry: {ahead.told(0)}; left {1e3 * ahead.rms:.0f} mm")
        print(f"turn over odometry: {around.told(0)}, and {around.told(1)} rad per metre; left {around.rms:.4f} rad")
        criticise(bag, output / name, name)
