# SPDX-License-Identifier: BSD-3-Clause
"""How the increments of a drive change when a rate changes by a curve: the derivative of equation (3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from kurumaisu import effects, geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive, edges_of
from kurumaisu.params import Model
from kurumaisu.sim import plant
from kurumaisu.types import FloatArray


class Sensitivity:
    """The derivative of a drive's body increments by rates that are added to its motion while the chair moves.

    An increment depends on the few cells of the grid that it spans, so the derivative is a sparse matrix: for all the
    columns of a basis at once, no sum over the whole drive is made.
    """

    def __init__(self, drive: Drive, motion: effects.Motion) -> None:
        poses = plant.path(motion, np.array([0.0, 0.0, motion.heading or 0.0]))
        moving = motion.moving.astype(float)
        self._weights = {
            name: GRID * moving * effects.factor(channel, motion) for name, channel in effects.CHANNELS.items()
        }
        self._heading = 0.5 * (poses[:-1, 2] + poses[1:, 2])
        # Anything summed over the grid is taken at the reference's times, linear within a cell: the share of it before.
        below, share = drive.places
        self._headings = drive.at_poses(poses[:, 2])
        counts = np.diff(below) + 1
        self._rows = np.append(0, np.cumsum(counts))  # where each increment's cells begin
        self._increment = np.repeat(np.arange(len(counts)), counts)
        self._cells = np.arange(self._rows[-1]) - self._rows[self._increment] + below[self._increment]
        self._first, last = self._rows[:-1], self._rows[1:] - 1
        self._before = share[:-1]
        self._spanned = np.ones(self._rows[-1])  # share of each cell that its increment spans
        self._spanned[last] = share[1:]
        self._spanned[self._first] -= self._before
        self._steps = np.diff(poses[:, :2], axis=0)
        self._derivatives: dict[str, list[csr_array]] = {}

    def increments(self, channel: str, rates: FloatArray | csr_array) -> FloatArray:
        """Return the change of the increments by rates (n, k) added to a channel, or by factors less 1; (3 m, k)."""
        if channel not in self._derivatives:
            self._derivatives[channel] = list(self._derivative(channel))
        out = np.zeros((len(self._first), 3, rates.shape[1]))
        for axis, derivative in enumerate(self._derivatives[channel]):
            change = derivative @ rates
            out[:, axis] = change if isinstance(change, np.ndarray) else change.toarray()
        return out.reshape(3 * len(out), rates.shape[1])

    def _derivative(self, channel: str) -> Iterator[csr_array]:
        """Yield the derivatives (m, n) of dx, dy and, where a channel turns the chair, of the turn."""
        rate = effects.CHANNELS[channel].rate
        along = self._turned() if rate == "w" else self._moved(np.pi / 2 if rate == "lateral" else 0.0)
        weights = self._weights[channel][self._cells]
        for part in along:
            yield csr_array((weights * part, self._cells, self._rows), shape=(len(self._first), len(self._steps)))

    def _moved(self, leftward: float) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives, per cell of each increment, of dx and dy by a way along a direction [rad]."""
        ahead = self._heading[self._cells] + leftward
        return self._in_body(self._spanned * np.cos(ahead), self._spanned * np.sin(ahead))

    def _turned(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the derivatives of dx, dy and the turn by a turn [rad]: what lies ahead of it swings round it."""
        x, y = (self._ahead(self._spanned * step[self._cells]) for step in self._steps.T)
        return *self._in_body(-y, x), self._spanned

    def _ahead(self, ways: FloatArray) -> FloatArray:
        """Return what of the ways (cells,) within an increment lies ahead of each of its cells, of its own one half."""
        total = np.add.reduceat(ways, self._first)
        sums = np.cumsum(ways)
        since = np.append(0.0, sums)[self._first]  # before each increment
        after = (since + total)[self._increment] - sums
        out = after + 0.5 * ways
        # The first cell's turn has partly been made when the increment begins.
        out[self._first] = (1 - self._before) * after[self._first] + (0.5 - self._before) * ways[self._first]
        return np.asarray(out)

    def _in_body(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        cos, sin = (side(self._headings[:-1])[self._increment] for side in (np.cos, np.sin))
        return cos * x + sin * y, cos * y - sin * x


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


def free_columns(drive: Drive, model: Model) -> FloatArray:
    """Return the columns (3 m, k) of a drive's increments, whose normal shares are its free moments before the data."""
    free = drive.free
    if free is None:
        return np.empty((3 * (len(drive.times) - 1), 0))
    near = (free.middles > drive.times[0] - free.width) & (free.middles < drive.times[-1] + free.width)
    motion = replay.motion(drive, model, ())
    moments = hats(drive, len(motion.moving), free.middles[near], free.width)
    return free.sd * Sensitivity(drive, motion).increments(free.channel, moments)


def all_free_columns(drives: Sequence[Drive], model: Model) -> list[FloatArray]:
    """Return the free columns of each of several drives, (3 m, k) each, k for the moments of all."""
    own = [free_columns(drive, model) for drive in drives]
    ends = np.cumsum([0, *(columns.shape[1] for columns in own)])
    return [
        np.pad(columns, ((0, 0), (before, ends[-1] - after)))
        for columns, (before, after) in zip(own, pairwise(ends.tolist()), strict=True)
    ]


def hats(drive: Drive, cells: int, middles: FloatArray, width: float, again: float = np.inf) -> FloatArray:
    """Return a hat about each of some middles [s], and again every so many, over a drive's grid, (cells, k)."""
    off = drive.start + GRID * (np.arange(cells) + 0.5)[:, np.newaxis] - middles
    if np.isfinite(again):
        off -= again * np.rint(off / again)
    return np.asarray(np.maximum(1 - np.abs(off) / width, 0.0))
