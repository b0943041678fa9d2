# SPDX-License-Identifier: BSD-3-Clause
"""Where the poses would have the chair stand, and the scans see it move: somebody fidgets in it, or it rolls slowly.

A reference that errs by millimetres does not see that. Taken for one pose, such a stand leaves what the chair moved in
the scans, by far more than their noise, and whole scans seem to be off together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kurumaisu.critic.ranges.noise.reading_noise import ELSEWHERE, OUTLIER, neighbours_correlation
from kurumaisu.critic.ranges.noise.shared_errors import whitened
from kurumaisu.critic.ranges.poses.pose_corrections import stands_of
from kurumaisu.critic.ranges.scans.beams import Shots, deviations, hits_of, moved_by_pose, predict, some_scans
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.valid_readings import usable_readings
from kurumaisu.critic.values.recording import Recording
from kurumaisu.params import Model
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

_CREEPS = 4.0  # times as much as noise alone would move poses, squared, from which a stand is none
_NARROWEST = 1e-4  # sds by the model that readings scatter by at least
_FEWEST = 10  # readings of a scan that tell a pose


def gather_stands(recording: Recording, model: Model) -> Shots:
    """Return the scans of the runs to fit, as gather, without stands in which the chair moves by the scans."""
    shots = gather(recording, model)
    creeping = creeping_stands(shots)
    return gather(recording, model, creeping) if creeping else shots


def creeping_stands(shots: Shots) -> Mapping[str, Sequence[float]]:
    """Return the names of runs, and a time [s] within each stand in which the chair moves, by their clock.

    Differences between the readings of a stand are compared: neither the map nor an error that lasts is in them. In
    front of a single wall they do not tell a chair that moves from readings that are off: if it does in most stands, it
    does in all.
    """
    stand = stands_of(shots)
    rows = np.flatnonzero(stand >= 0)
    if not len(rows):
        return {}
    some, stand = some_scans(shots, rows), stand[rows]
    seen = hits_of(some, (), 0)
    base = predict(some, (), seen, 0)
    sd = deviations(some, seen, base)
    poses = moved_by_pose(some, seen)
    valid = usable_readings(some, seen, base)
    every = [np.flatnonzero(stand == one) for one in np.unique(stand)]
    told = [_creeps(some.measured[own], valid[own], sd[own], poses[own]) for own in every]
    mostly = told.count(True) > told.count(False)
    out: dict[str, list[float]] = {}
    for own, creeps in zip(every, told, strict=True):
        if creeps or mostly:
            out.setdefault(shots.runs[some.run[own[0]]], []).append(float(some.stamps[own[0]]) + shots.zero)
    return out


def _creeps(readings: FloatArray, valid: BoolArray, sd: FloatArray, poses: FloatArray) -> bool | None:
    """Tell whether scans (k, b) [m] of a stand were taken from several poses; None where that cannot be told.

    sd (k, b) [m]: of readings by the model; poses (k, b, 3): what errors of the pose do to them, per metre and radian.
    """
    off, use = _differences(readings, valid, sd)
    told = np.flatnonzero(use.sum(axis=1) >= _FEWEST)
    if len(told) < 2:
        return None
    off, use, sd, poses = off[told], use[told], sd[told], poses[told]
    _, left = _moved(off, use, sd, poses, 0.0)
    width = max(SIGMA_PER_MAD * float(np.nanmedian(np.abs(left))), _NARROWEST)
    rho = neighbours_correlation(left / width, np.abs(left) < OUTLIER * width)
    moved, _ = _moved(off, use, width * sd, poses, rho)
    return moved > _CREEPS * 3 * len(told)


def _differences(readings: FloatArray, valid: BoolArray, sd: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return how far readings (k, b) are from the mean of their beam, scattered as single ones, and which count."""
    near = np.where(valid, readings, np.inf)
    middle = np.sort(near, axis=0)[np.maximum(valid.sum(axis=0) - 1, 0) // 2, range(near.shape[1])]
    with np.errstate(invalid="ignore"):
        use = valid & (np.abs(readings - middle) < ELSEWHERE * sd)
    count = use.sum(axis=0)
    use &= count > 1
    mean = np.where(use, readings, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(use, readings - mean, 0.0) / np.sqrt(1 - 1 / np.maximum(count, 2)), use


def _moved(off: FloatArray, use: BoolArray, sd: FloatArray, poses: FloatArray, rho: float) -> tuple[float, FloatArray]:
    """Return how far poses of their own move the scans (k, b), squared, in sds, and what they leave [sd].

    Beside what moves a whole scan; rho: how neighbours correlate.
    """
    moved, left = 0.0, np.full(off.shape, np.nan)
    for k in range(len(off)):
        columns = np.column_stack([np.ones(off.shape[1]), poses[k]])
        rows = whitened(np.column_stack([columns, off[k]]), use[k], sd[k], rho)
        q, r = np.linalg.qr(rows[:, :-1])
        along = q.T @ rows[:, -1]
        moved += float(along[1:] @ along[1:])
        fitted = columns @ np.linalg.lstsq(r, along, rcond=None)[0]
        left[k, use[k]] = ((off[k] - fitted) / sd[k])[use[k]]
    return moved, left
