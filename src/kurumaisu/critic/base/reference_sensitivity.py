# SPDX-License-Identifier: BSD-3-Clause
"""How the increments of a drive change when what a reference measures of the pose is off by a curve."""

from __future__ import annotations

import numpy as np

from kurumaisu import effects, geometry
from kurumaisu.critic.base.drive import Drive, edges_of
from kurumaisu.sim import plant
from kurumaisu.types import FloatArray


def reference_increments(drive: Drive, motion: effects.Motion, channel: str, errors: FloatArray) -> FloatArray:
    """Return the change of the increments by errors (n + 1, k) at the grid's edges in a channel of the reference.

    (3 m, k).
    """
    poses = drive.at_poses(plant.path(motion, np.array([0.0, 0.0, motion.heading or 0.0])))
    known = motion.known.get("heading")
    heading = poses[:, 2] if known is None else drive.at_poses(edges_of(known))
    axis, _ = effects.REFERENCE_CHANNELS[channel]
    size = drive.at_poses(errors)
    steps = geometry.between(poses[:-1], poses[1:])
    out = np.zeros((len(steps), 3, errors.shape[1]))
    before, after = size[:-1], size[1:]
    if axis == 2:  # what is seen turned to the left goes to the right
        out[:, 0], out[:, 1] = steps[:, 1:2] * before, -steps[:, 0:1] * before
        out[:, 2] = after - before
    else:  # a shift in the map, as the chair sees it
        ahead = 0.5 * np.pi * axis - heading
        at_end, at_start = ahead[1:] + steps[:, 2], ahead[:-1]
        out[:, 0] = np.cos(at_end)[:, np.newaxis] * after - np.cos(at_start)[:, np.newaxis] * before
        out[:, 1] = np.sin(at_end)[:, np.newaxis] * after - np.sin(at_start)[:, np.newaxis] * before
    return out.reshape(3 * len(steps), -1)
