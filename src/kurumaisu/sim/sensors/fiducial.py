# SPDX-License-Identifier: BSD-3-Clause
"""The finder of marked models: who is where, and facing which way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from kurumaisu.geometry import cos_sin, wrap
from kurumaisu.sim.sensors.rays import Rays
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world.model import Fiducial, Model


@dataclass(frozen=True)
class Sightings:
    """What finders saw, (s,) each.

    finder: its number; model: its index in the world; id: its fiducial_return, 0 where it is too far to be told;
    range [m] and bearing [rad] of its origin; heading [rad] relative to the finder's.
    """

    finder: IntArray
    model: IntArray
    id: IntArray
    range: FloatArray
    bearing: FloatArray
    heading: FloatArray

    def of(self, finder: int) -> Sightings:
        """Return what one finder saw, as if it were the only one."""
        rows = self.finder == finder
        seen = Sightings(*(getattr(self, field.name)[rows] for field in fields(self)))
        return replace(seen, finder=np.zeros_like(seen.finder))


class FiducialFinder:
    """Finds models whose fiducial_return is not 0 and whose key is the finder's.

    A model is seen if its own outline is the first thing on the line to its origin, at the finder's height. As in
    Stage: range_min has no effect, and whatever stands on the model hides it where it protrudes towards the finder.
    """

    def __init__(self, fiducial: Fiducial, models: Sequence[Model]) -> None:
        """Note the marked models of the world."""
        self._fiducial = fiducial
        marked = [m for m in models if m.fiducial_return != 0 and m.fiducial_key == fiducial.key]
        self._marked: IntArray = np.array([m.index for m in marked], dtype=np.int64)
        self._ids: IntArray = np.array([m.fiducial_return for m in marked], dtype=np.int64)
        self._roots: IntArray = np.array([m.root for m in marked], dtype=np.int64)
        self._counts: IntArray = np.array([len(m.shape.segments) for m in marked], dtype=np.int64)
        self._starts = np.cumsum(self._counts) - self._counts
        self._outlines = np.concatenate(
            [np.empty((0, 6)), *(np.hstack([m.shape.segments, m.shape.heights]) for m in marked)]
        )

    def find(self, rays: Rays, finders: FloatArray, trees: IntArray, poses: FloatArray) -> Sightings:
        """Return what finders at global poses (f, 4), of trees (f,), see of models at poses (n, 4)."""
        f = self._fiducial
        targets = poses[self._marked]
        close = np.abs(targets[None, :, 0] - finders[:, None, 0]) < f.range_max
        close &= np.abs(targets[None, :, 1] - finders[:, None, 1]) < f.range_max
        finder, target = np.nonzero(close & (self._roots[None] != trees[:, None]))
        offset = targets[target, :2] - finders[finder, :2]
        ranges = np.hypot(offset[:, 0], offset[:, 1])
        bearings = wrap(np.arctan2(*np.ascontiguousarray(offset.T[::-1])) - finders[finder, 3])
        near = (ranges < f.range_max) & (np.abs(bearings) <= f.fov / 2)
        finder, target, ranges, bearings = finder[near], target[near], ranges[near], bearings[near]
        lines = finders[finder].copy()
        lines[:, 3] += bearings
        seen = self._in_sight(rays, lines, trees[finder], target, targets[target])
        finder, target, ranges, bearings = finder[seen], target[seen], ranges[seen], bearings[seen]
        return Sightings(
            finder=finder,
            model=self._marked[target],
            id=np.where(ranges < f.range_max_id, self._ids[target], 0),
            range=ranges,
            bearing=bearings,
            heading=wrap(targets[target, 3] - finders[finder, 3]),
        )

    def _in_sight(
        self, rays: Rays, lines: FloatArray, trees: IntArray, target: IntArray, poses: FloatArray
    ) -> BoolArray:
        if not len(lines):
            return np.zeros(0, dtype=bool)
        hits, _ = rays.cast(lines, trees, self._fiducial.range_max)
        own = self._own_outline(lines, target, poses)
        rounding = 1e-9  # [m] of the same crossing computed twice
        in_sight = np.isfinite(own) & (own <= hits + rounding)
        if self._fiducial.ignore_zloc:
            in_sight |= np.isinf(hits)
        return np.asarray(in_sight)

    def _own_outline(self, lines: FloatArray, target: IntArray, poses: FloatArray) -> FloatArray:
        """Return how far along each line (s, 4) the outline of its target is, at the line's height; inf: nowhere."""
        counts = self._counts[target]
        line = np.repeat(np.arange(len(target)), counts)
        within = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
        walls = self._outlines[np.repeat(self._starts[target], counts) + within]
        pose, ray = poses[line], lines[line]
        ax, ay = _seen_from(ray, pose, walls[:, 0], walls[:, 1])
        bx, by = _seen_from(ray, pose, walls[:, 2], walls[:, 3])
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ax + (bx - ax) * ay / (ay - by)
        height = ray[:, 2] - pose[:, 2]
        met = (ay * by <= 0) & (ay != by) & (distance >= 0) & (walls[:, 4] <= height) & (height <= walls[:, 5])
        nearest = np.full(len(target), np.inf)
        np.minimum.at(nearest, line[met], distance[met])
        return nearest


def _seen_from(ray: FloatArray, pose: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (x, y) of bodies at poses along and beside rays."""
    c, s = cos_sin(pose[:, 3])
    dx, dy = pose[:, 0] + c * x - s * y - ray[:, 0], pose[:, 1] + s * x + c * y - ray[:, 1]
    c, s = cos_sin(ray[:, 3])
    return c * dx + s * dy, c * dy - s * dx
