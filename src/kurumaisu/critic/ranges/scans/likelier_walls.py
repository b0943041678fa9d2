# SPDX-License-Identifier: BSD-3-Clause
"""Maps of pixels, in which askew walls are stairs: readings of a simulator that has those, or of straight walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.ranges.scans.beams import Shots, hits_of, moved_by_pose, predict, smoothed
from kurumaisu.critic.ranges.scans.valid_readings import usable_beams
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

_CLIP = 3.0  # robust sds at which a reading counts as an outlier
_ROUNDS = 3  # of fitting poses to scans
_TRIES = 40
_LEFT = 0.5  # share of the readings of straight walls that are away from edges of stairs, below which too few are left
_ROUGHER = 1.1  # times as far as readings scatter about the others, up to which nobody can say which walls they are of
_SEARCHED = np.array([0.003, 0.003, 0.001])  # [m, rad] of them about what was fitted, 1 sd, at first


def with_likelier_walls(shots: Shots) -> Shots:
    """Return shots with straight walls in place of pixels, unless the readings have their stairs: then with those.

    Where these are so fine that they are lost in the noise, nobody can say: straight walls have both, then.

    Whether they have is seen where the scans put the chair: a reference that errs by more than a pixel tells nothing.
    """
    if shots.walls.drawn is None:
        return shots
    even = replace(shots, tracks=tuple(map(smoothed, shots.tracks)))
    place = _fitted(even)
    _, met = _errors(even, place)
    # Pixels have no slopes that lead to where the chair was.
    straight, drawn = (
        _least_scatter(replace(even, walls=walls), place, met) for walls in (shots.walls, shots.walls.drawn)
    )
    if met.any() and drawn / _ROUGHER < straight < _ROUGHER * drawn:
        return shots
    if straight < drawn or not met.any():
        return replace(shots, walls=replace(shots.walls, drawn=None))
    _, left = _errors(replace(even, walls=shots.walls.drawn), place)
    return replace(shots, walls=replace(shots.walls.drawn, stairs=bool(left.sum() < _LEFT * met.sum())))


def _doubt(shots: Shots) -> FloatArray:
    """Return what the poses of each scan (k, 3) [m, rad] err, 1 sd."""
    return np.array([track.doubt for track in shots.tracks])[shots.run][:, [0, 0, 1]]


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


def _least_scatter(shots: Shots, place: FloatArray, met: BoolArray) -> float:
    """Return how far readings of walls scatter [m], a constant apart, from the best poses about place (k, b, 3)."""
    rng = np.random.default_rng(0)
    least, best = np.full(len(place), np.inf), place
    far = 0.0
    for n in range(_TRIES + 1 if met.any() else 0):
        size = _SEARCHED * (1 - n / _TRIES) if n else np.zeros(3)
        tried = best + (size * rng.standard_normal((len(place), 3)))[:, np.newaxis]
        off = np.where(met, shots.measured - predict(shots, (), hits_of(shots, (), 0, shift=tried), 0), np.nan)
        off -= np.nanmedian(off)
        far = far or _CLIP * float(np.nanmedian(np.abs(off)))
        scatter = np.nansum(np.square(np.clip(off, -far, far)), axis=1)
        better = scatter < least
        least, best = np.where(better, scatter, least), np.where(better[:, np.newaxis, np.newaxis], tried, best)
    return float(np.sqrt(least.sum() / max(met.sum(), 1)))
