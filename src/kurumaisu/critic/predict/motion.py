# SPDX-License-Identifier: BSD-3-Clause
"""Where a chair will be: motion from t0 to t1 by the inputs, given the reference's poses up to t0 and none after.

Predicted is what the reference would measure: its row at t1 as seen from its row at t0. So the error of both rows
counts, of which that at t0 is partly known, because the rows before it say where the chair really was. What the noise
of the rates is doing at t0 is known in the same way, and goes on for some time constants.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, POSE_INTERVAL, Drive
from kurumaisu.critic.noise.base_noise import Noise, whitened
from kurumaisu.critic.values.criticism import Settings
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_SAME = 1e-6  # [s] within which a stamp is meant
_MEMORY = 6.0  # time constants of the noise that are looked back on
_LEAST_MEMORY = 5.0  # [s]
_MOST_ROWS = 400  # that are looked back on
_STEP = 0.25  # [s] into which the way ahead is cut: a rate's error acts along its mean heading
_MOST_STEPS = 40
_PLACE = ("x", "y", "heading")  # that a drive knows of itself, from its poses
_PASSES = 2  # of a path that depends on where it leads
_NOTHING = 1e-9  # [m], [rad]


@dataclass(frozen=True)
class Forecast:
    """What is needed to predict motion: the extended model, its noise, and models that it might as well be."""

    model: Model
    settings: Settings
    noise: Noise
    others: tuple[Settings, ...] = ()


# From a drive, times (n,) [s], and rows of its poses that may be used: poses (n, 3) at those times by a model, in a
# frame of its own, and as many by each other one.
Way = Callable[[Drive, FloatArray, Sequence[int]], tuple[FloatArray, list[FloatArray]]]


def motion_ahead(drive: Drive, way: Way, noise: Noise, t0: float, t1: float) -> tuple[FloatArray, FloatArray]:
    """Return the motion from t0 to t1 [s] in the body frame at t0: mean (3,) and covariance (3, 3) [m, m, rad].

    drive: all its poses, of which those after t0 are not used. way: what the reference would see of the model, on the
    drive's inputs up to t1 at least.
    """
    past = _past(drive, noise, t0)
    last = float(drive.times[past[-1]]) if len(past) else t0
    knots = _knots(last, t0, t1)
    times = np.concatenate([drive.times[past[:-1]], knots])
    sim, others = way(drive, times, past)
    steps = geometry.between(sim[:-1], sim[1:])
    turned = [geometry.between(other[:-1], other[1:]) - steps for other in others]
    start = drive.poses[past[-1]] if len(past) else np.zeros(3)
    here = max(len(past) - 1, 0)  # row of the last measured pose
    ahead = geometry.compose(start, geometry.between(sim[here], sim[here:]))
    poses = np.concatenate([drive.poses[past[:-1]], ahead])
    error = geometry.between(poses[:-1], poses[1:])[:here] - steps[:here]
    error[:, 2] = geometry.wrap(error[:, 2])  # across a gap nobody counted the turns
    mean, covariance = _conditional(drive, times, poses, error, turned, noise)
    begin = int(np.argmin(np.abs(times[here:] - t0)))  # steps before it lead from the last pose to t0
    return _composed(steps[here:] + mean, covariance, begin)


def _past(drive: Drive, noise: Noise, t0: float) -> list[int]:
    """Return rows up to t0, in order, the last one first chosen, as far apart as those the noise was estimated on."""
    slow = noise.slow_tau if noise.slow_v or noise.slow_w else 0.0
    tau = max(noise.tau, slow, noise.lasting_tau if noise.lasting else 0.0)
    since = t0 - max(_MEMORY * tau, _LEAST_MEMORY, 3 * POSE_INTERVAL[drive.source])
    least = POSE_INTERVAL[drive.source] * (1 - _SAME)
    rows: list[int] = []
    row = int(np.searchsorted(drive.times, t0 + _SAME)) - 1
    while row >= 0 and len(rows) < _MOST_ROWS and (not rows or drive.times[row] >= since):
        rows.append(row)
        row = int(np.searchsorted(drive.times, drive.times[row] - least, side="right")) - 1
    return rows[::-1]


def _knots(last: float, t0: float, t1: float) -> FloatArray:
    """Return times from the last pose by way of t0 to t1."""
    parts = [np.array([last])]
    for begin, end in ((last, t0), (t0, t1)):
        if end - begin > _SAME:
            count = int(np.clip(np.ceil((end - begin) / _STEP), 1, _MOST_STEPS))
            parts.append(np.linspace(begin, end, count + 1)[1:])
    return np.concatenate(parts)


def _conditional(
    drive: Drive, times: FloatArray, poses: FloatArray, error: FloatArray, turned: Sequence[FloatArray], noise: Noise
) -> tuple[FloatArray, FloatArray]:
    """Return mean (f, 3) and covariance (3 f, 3 f) of what is added to the last f steps, given the errors before.

    turned: how the steps change by errors of the model that are independent and of sd 1.
    """
    known, rows = error.size, 3 * (len(times) - 1)
    first = np.zeros(rows)
    first[:known] = error.ravel()
    doubt = np.column_stack([change.ravel() for change in turned]) if turned else np.empty((rows, 0))
    columns = np.hstack([first[:, None], doubt, np.eye(rows)[:, known:]])
    white, _ = whitened(drive.seen_at(times, poses), columns, noise)
    k = 1 + doubt.shape[1]
    # Each row of `white` is a unit normal: what is measured, less what the doubt makes of it.
    by = white[:known, 1:k]
    spread = np.linalg.inv(np.eye(k - 1) + by.T @ by)
    guess = spread @ (by.T @ white[:known, 0])
    unit, swing = white[known:, k:], white[known:, 1:k]
    mean = np.linalg.solve(unit, swing @ guess - white[known:, 0])
    inverse = np.linalg.inv(unit)
    covariance = inverse @ (np.eye(len(unit)) + swing @ spread @ swing.T) @ inverse.T
    return mean.reshape(-1, 3), np.asarray(covariance)


def _composed(steps: FloatArray, covariance: FloatArray, begin: int) -> tuple[FloatArray, FloatArray]:
    """Return the motion that steps (f, 3) from `begin` on add up to, their covariance carried along to first order."""
    places = [np.zeros(3)]
    for step in steps[begin:]:
        places.append(geometry.compose(places[-1], step))
    end = places[-1]
    carried = np.zeros((3, 3 * len(steps)))
    for i in range(begin, len(steps)):
        before, after = places[i - begin], places[i - begin + 1]
        c, s = np.cos(before[2]), np.sin(before[2])
        rest = end - after  # swings with the turn of this step
        carried[:, 3 * i : 3 * i + 3] = [[c, -s, -rest[1]], [s, c, rest[0]], [0, 0, 1]]
    return end, np.asarray(carried @ covariance @ carried.T)


class Paths:
    """Paths by a model and by others that it might as well be, all on the same inputs."""

    def __init__(
        self, drive: Drive, model: Model, settings: Sequence[EffectSetting], others: Sequence[Sequence[EffectSetting]]
    ) -> None:
        """Take others: settings that each lie one standard deviation from those given, independently."""
        self._model, self._settings = model, settings
        drive = drive if len(drive.poses) else drive.seen_at(np.array([drive.start]), np.zeros((1, 3)))
        self._times = drive.start + GRID * np.arange(len(drive.v))
        blind = _knowing(drive, {name: np.zeros(len(drive.v)) for name in _PLACE})
        self._path = self._run(blind, settings)
        self._others = [self._run(blind, other) for other in others]
        turned = _knowing(drive, {name: np.ones(len(drive.v)) for name in _PLACE})
        moved = self._run(replace(turned, poses=drive.poses + np.array([1.0, 1.0, 1.0])), settings)
        apart = geometry.between(moved[:-1], moved[1:]) - geometry.between(self._path[:-1], self._path[1:])
        self.placed = bool(np.abs(apart).max(initial=0.0) > _NOTHING)  # depends on where the chair is
        if self.placed:  # the doubt is small: it may know poses that the path itself must not know
            seen = _knowing(drive, _interpolated(drive, range(len(drive.times)), self._times))
            self._base = self._run(seen, settings)
            self._others = [self._run(seen, other) for other in others]

    def at(self, drive: Drive, times: FloatArray, past: Sequence[int]) -> tuple[FloatArray, list[FloatArray]]:
        """Return poses (n, 3) at times by the model, in a frame of its own, and as many by each other one.

        past: rows of the drive's poses, none after t0, that may be used.
        """
        if not self.placed:
            return self._of(self._path, times), [self._of(other, times) for other in self._others]
        path = self._from(drive, past)
        own, base = self._of(path, times), self._of(self._base, times)
        # Others as they differ from the model where all poses are known, laid upon the path that knows the past alone.
        return own, [_added(own, base, self._of(other, times)) for other in self._others]

    def _from(self, drive: Drive, past: Sequence[int]) -> FloatArray:
        """Return the path that knows where the chair was by those rows, and then goes where it leads by itself."""
        if not len(past):
            return self._path
        known = _interpolated(drive, past, self._times)
        poses = drive.poses
        for _ in range(_PASSES):
            path = self._run(replace(_knowing(drive, known), poses=poses), self._settings)
            here = self._of(path, drive.times[past[-1:]])[0]
            there = geometry.compose(drive.poses[past[-1]], geometry.between(here, path))
            after = self._times > drive.times[past[-1]]
            known = {name: np.where(after, there[:, i], known[name]) for i, name in enumerate(_PLACE)}
            poses = poses + np.array([0.0, 0.0, there[0, 2] - poses[0, 2]])  # the heading that leads to the last one
        return path

    def _run(self, drive: Drive, settings: Sequence[EffectSetting]) -> FloatArray:
        return replay.measured_poses(replace(drive, times=self._times), self._model, settings)

    def _of(self, path: FloatArray, times: FloatArray) -> FloatArray:
        return geometry.interpolate(self._times, path, times)


def _knowing(drive: Drive, places: Mapping[str, FloatArray]) -> Drive:
    return replace(drive, known={**drive.known, **places})


def _interpolated(drive: Drive, rows: Sequence[int], at: FloatArray) -> dict[str, FloatArray]:
    """Return where the chair was by some of the reference's rows, held before the first and after the last."""
    chosen = np.asarray(rows, dtype=int)
    if not len(chosen):
        return {name: np.zeros(len(at)) for name in _PLACE}
    return {name: np.interp(at, drive.times[chosen], drive.poses[chosen, i]) for i, name in enumerate(_PLACE)}


def _added(own: FloatArray, base: FloatArray, other: FloatArray) -> FloatArray:
    """Return a path whose steps are those of `own`, and what those of `other` have more than those of `base`."""
    more = geometry.between(other[:-1], other[1:]) - geometry.between(base[:-1], base[1:])
    out = [own[0]]
    for step in geometry.between(own[:-1], own[1:]) + more:
        out.append(geometry.compose(out[-1], step))
    return np.array(out)
