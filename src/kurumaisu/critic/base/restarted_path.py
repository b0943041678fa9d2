# SPDX-License-Identifier: BSD-3-Clause
"""A simulated path in pieces that begin at measured poses, to be seen beside the measured one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base.drive import Drive
from kurumaisu.types import FloatArray

PICTURE = 0.1  # [s] between the poses drawn
# [s] after which a simulated path begins again at the measured pose: the random wander of the heading adds up, and
# after a minute hides what the model does.
RESTART = 10.0


def restarted_path(drive: Drive, path: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
    """Yield the pieces of a simulated path (n, 3): rows of the drive's poses, and poses (k, 3) in the map there.

    The last row of a piece is the first of the next: there the one has ended, and the other begins.
    """
    since = drive.times - drive.times[0]
    bounds = np.unique([*np.flatnonzero(np.diff(since // RESTART, prepend=-1.0)), len(since) - 1])
    for a, b in pairwise(bounds.tolist()):
        rows = slice(a, b + 1)
        yield rows, geometry.compose(drive.poses[a], geometry.between(path[a], path[rows]))
