# SPDX-License-Identifier: BSD-3-Clause
"""Maps of pixels, in which askew walls are stairs: readings of a simulator that has those, or of straight walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.ranges.scans.beams import Shots, hits_of, moved_by_pose, predict, smoothed
from kurumaisu.critic.ranges.scans.valid_readings import usable_beams
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

_DRAWS = 8  # of poses that err
_FAR = 0.3  # [m] from a straight wall, where a beam meets another one
_CLIP = 3.0  # robust sds at which a reading counts as an outlier
_ROUNDS = 3  # of fitting poses to scans
_TRIES = 40
_SEARCHED = np.array([0.003, 0.003, 0.001])  # [m, rad] of them about what was fitted, 1 sd, at first
_FOUND = np.array([0.0005, 0.0005, 0.0002])  # [m, rad] that poses err then, 1 sd


def with_likelier_walls(shots: Shots) -> Shots:
    """Return shots with straight walls in place of pixels, and with their stairs if the readings have them.

    Whether they have is seen where the scans put the chair: a reference that errs by more than a pixel tells nothing.
    """
    if shots.walls.drawn is None:
        return shots
    even = replace(shots, tracks=tuple(map(smoothed, shots.tracks)))
    place = _fitted(even)
    _, walls = _errors(even, place)
    # Pixels have no slopes that lead to where the chair was.
    straight, _ = _searched(even, place, walls)
    drawn, there = _searched(replace(even, walls=shots.walls.drawn), place, walls)
    if not walls.any() or straight < drawn:
        return replace(shots, walls=replace(shots.walls, drawn=None))
    known = _with_stairs(even, there, np.broadcast_to(_FOUND, (len(there), 3)))
    return replace(shots, stairs=known.stairs, rough=known.rough)


def with_stairs(shots: Shots) -> Shots:
    """Return shots that know the stairs of their walls, as far as those are meant to be met, from the track's poses."""
    if shots.walls.drawn is None:
        return shots
    return _with_stairs(shots, np.zeros_like(shots.shift), _doubt(shots))


def _doubt(shots: Shots) -> FloatArray:
    """Return what the poses of each scan (k, 3) [m, rad] err, 1 sd."""
    return np.array([track.doubt for track in shots.tracks])[shots.run][:, [0, 0, 1]]


def _with_stairs(shots: Shots, place: FloatArray, doubt: FloatArray) -> Shots:
    """Return shots that know their stairs; place (k, b, 3): added to the poses; doubt (k, 3): what they err, 1 sd."""
    assert shots.walls.drawn is not None
    each = (replace(shots, walls=shots.walls.drawn), shots)
    rng = np.random.default_rng(0)
    offs = []
    for _ in range(_DRAWS):
        moved = place + (doubt * rng.standard_normal(doubt.shape))[:, np.newaxis]
        with np.errstate(invalid="ignore"):
            off = np.subtract(*(hits_of(one, (), 0, shift=moved).level for one in each))
        offs.append(np.where(np.abs(off) < _FAR, off, np.nan))
    many = np.isfinite(offs).sum(axis=0) > 1
    mean, sd = np.zeros((2, *many.shape))
    mean[many], sd[many] = np.nanmean(np.array(offs)[:, many], axis=0), np.nanstd(np.array(offs)[:, many], axis=0)
    return replace(shots, stairs=mean, rough=sd)


def _fitted(shots: Shots) -> FloatArray:
    """Return by how much the poses (k, b, 3) [m, rad] of all beams are to be moved to where the readings put them.

    Over a scan they may be off as they would be at another rate.
    """
    place = np.zeros_like(shots.shift)
    doubt = np.tile(_doubt(shots), 2)
    during = np.linspace(-1.0, 1.0, shots.laser.beams)[:, np.newaxis]
    moves = moved_by_pose(shots, hits_of(shots, (), 0))
    moves = np.concatenate([moves, moves * during], axis=2)
    at = np.zeros_like(doubt)
    for _ in range(_ROUNDS):
        off, seen = _errors(shots, place)
        if not seen.any():
            break
        off = off - np.median(off[seen])  # what all are off is no pose
        sd = SIGMA_PER_MAD * np.median(np.abs(off[seen]))
        for k in range(len(place)):
            one, left = moves[k, seen[k]], np.clip(off[k, seen[k]], -_CLIP * sd, _CLIP * sd)
            prior = (sd / doubt[k]) ** 2
            at[k] += np.linalg.solve(one.T @ one + np.diag(prior), one.T @ left - prior * at[k])
        place = at[:, np.newaxis, :3] + at[:, np.newaxis, 3:] * during
    return place


def _errors(shots: Shots, place: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return how far readings (k, b) [m] are off from moved poses, and which of them are of walls."""
    seen = hits_of(shots, (), 0, shift=place)
    base = predict(shots, (), seen, 0)
    off = shots.measured - base
    return off, usable_beams(shots, seen, base) & np.isfinite(off)


def _searched(shots: Shots, place: FloatArray, walls: BoolArray) -> tuple[float, FloatArray]:
    """Return how far readings of walls scatter [m], a constant apart, and from which place (k, b, 3) least."""
    rng = np.random.default_rng(0)
    least, best = np.full(len(place), np.inf), place
    far = 0.0
    for n in range(_TRIES + 1 if walls.any() else 0):
        size = _SEARCHED * (1 - n / _TRIES) if n else np.zeros(3)
        tried = best + (size * rng.standard_normal((len(place), 3)))[:, np.newaxis]
        off = np.where(walls, shots.measured - predict(shots, (), hits_of(shots, (), 0, shift=tried), 0), np.nan)
        off -= np.nanmedian(off)
        far = far or _CLIP * float(np.nanmedian(np.abs(off)))
        scatter = np.nansum(np.square(np.clip(off, -far, far)), axis=1)
        better = scatter < least
        least, best = np.where(better, scatter, least), np.where(better[:, np.newaxis, np.newaxis], tried, best)
    return float(np.sqrt(least.sum() / max(walls.sum(), 1))), best
