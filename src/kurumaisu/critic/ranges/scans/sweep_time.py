# SPDX-License-Identifier: BSD-3-Clause
"""How long a scan with fewer beams takes: some records keep every fifth beam, other sensors have no more of them.

The mirror of the first turns as fast as the model's, so that its beams are fired with as much more time between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.ranges.scans.beams import Shots, hits_of, predict, smoothed
from kurumaisu.critic.ranges.scans.gathering import gather, why_not_usable
from kurumaisu.critic.values.recording import Recording
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_COARSER = 1.3  # times the model's angle between beams, from which they may have been thinned out
_LATER = 0.01  # [s] by which all beams are fired later, to see what a delay does
_NEAR = 0.1  # [m] beyond which a reading is of another wall


def with_sweep_time(recording: Recording, model: Model) -> Recording:
    """Return a recording whose laser has the time between its beams [s]: of the model's, or as much more as its angle.

    As it is where the recording says it, or nothing tells; of both, what the readings are nearer to, beside a delay.
    """
    laser, usual = recording.laser, model.laser
    if laser is None or laser.time_increment is not None or why_not_usable(recording) is not None:
        return recording
    coarser = abs(laser.angle_increment / usual.angle_increment)
    if coarser < _COARSER or usual.time_increment <= 0 or any(run.fan is not None for run in recording.runs):
        return recording
    shots = gather(recording, model)
    turned = _share_of_turn(shots, coarser)
    increment = usual.time_increment * (coarser if turned > 1 / 2 else 1.0)
    return replace(recording, laser=replace(laser, time_increment=increment))


def _share_of_turn(shots: Shots, coarser: float) -> float:
    """Return which share of what more time between beams would do to the readings is in them.

    Beside what a delay does, and a clock that runs fast or slow.
    """
    left = shots.measured - _readings(shots, shots.said)
    even = replace(shots, tracks=tuple(map(smoothed, shots.tracks)))
    now = _readings(even, shots.said)
    slower, later = (_readings(even, said) - now for said in (coarser * shots.said, shots.said + _LATER))
    since = (shots.stamps / max(float(np.abs(shots.stamps).max()), 1.0))[:, np.newaxis]
    with np.errstate(invalid="ignore"):
        use = (np.abs(left) < _NEAR) & (np.abs(slower) < _NEAR) & (np.abs(later) < _NEAR)
    columns = np.stack([slower[use], later[use], (since * later)[use]], axis=1)
    return float(np.linalg.lstsq(columns, left[use], rcond=None)[0][0]) if use.any() else 0.0


def _readings(shots: Shots, said: FloatArray) -> FloatArray:
    """Return what the model reads (k, b) [m] with beams fired at other times (b,) [s] after the stamp."""
    moved = replace(shots, said=said)
    return predict(moved, (), hits_of(moved, (), 0), 0)
