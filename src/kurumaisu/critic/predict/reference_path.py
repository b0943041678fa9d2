# SPDX-License-Identifier: BSD-3-Clause
"""What the reference would see of a model on a drive's inputs, also where it has not looked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_PLACE = ("x", "y", "heading")  # that a drive knows of itself, from its poses
_PASSES = 2  # of a path that depends on where it leads
_NOTHING = 1e-9  # [m], [rad]


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

    def at(
        self, drive: Drive, times: FloatArray, past: Sequence[int], t0: float
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Return poses (n, 3) at times by the model, in a frame of its own, and as many by each other one.

        past: rows of the drive's poses, none after t0, that may be used.
        """
        if not self.placed:
            return self._of(self._path, times), [self._of(other, times) for other in self._others]
        path = self._from(drive, past, t0)
        own, base = self._of(path, times), self._of(self._base, times)
        # Others as they differ from the model where all poses are known, laid upon the path that knows the past alone.
        return own, [_added(own, base, self._of(other, times)) for other in self._others]

    def _from(self, drive: Drive, past: Sequence[int], t0: float) -> FloatArray:
        """Return the path that knows where the chair was until t0, and then goes where it leads by itself."""
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
