# SPDX-License-Identifier: BSD-3-Clause
"""What noise alone makes of a path that is predicted from the inputs: no model can do better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.heldout.materiality import spans
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.predict.motion import motion_ahead
from kurumaisu.critic.predict.reference_path import Paths
from kurumaisu.params import EffectSetting, Model

_STARTS = 8  # per drive and horizon


def squares(
    drive: Drive, model: Model, settings: Sequence[EffectSetting], noise: Noise, horizons: Sequence[float]
) -> Iterator[tuple[float, float]]:
    """Yield horizons [s] and mean squared errors of the position [m^2] after each, from some poses of a drive.

    From one pose as the reference gives it to another: nothing is known of how the noise was before.
    """
    paths = Paths(drive, model, tuple(settings), ())
    for horizon in horizons:
        starts, ends = spans(drive, horizon)
        few = np.unique(np.linspace(0, len(starts) - 1, _STARTS).astype(int)) if len(starts) else []
        for i in few:
            row = slice(starts[i], starts[i] + 1)
            alone = drive.seen_at(drive.times[row], drive.poses[row])
            ahead = motion_ahead(alone, paths, noise, float(drive.times[starts[i]]), float(drive.times[ends[i]]))
            yield horizon, float(ahead.covariance[0, 0] + ahead.covariance[1, 1])
