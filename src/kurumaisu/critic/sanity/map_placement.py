# SPDX-License-Identifier: BSD-3-Clause
"""Where on a map does what was seen lie? Tried: all turns, shifts, mirror images and some scales of the map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from kurumaisu.types import FloatArray

_CELLS = 128  # on either side of the middle
_TURNS = np.radians(np.arange(0, 360, 6))
_SCALES = (1.0, 0.5, 2.0, 0.1, 10.0, 0.01, 100.0, 1e-3, 1e3)
_POINTS = 1500  # that are fitted
_HARDLY = 0.05  # share of the size of what is seen, by which a map may move: poses or mounting are a little off
_ROUNDS = 25
_KEPT = 0.7  # share of the points that are nearest to a wall, in the fit


@dataclass(frozen=True)
class MapPlacement:
    """A map as it would have to lie: segments (m, 4) [m], the words for it, and whether it hardly moved."""

    segments: FloatArray
    words: str
    small: bool


def nearest_maps(points: FloatArray, segments: FloatArray) -> Iterator[MapPlacement]:
    """Yield maps moved so that most of the points (n, 2) [m] lie on the walls (m, 4), the simplest changes first."""
    walls = _along(segments)
    few = points[np.linspace(0, len(points) - 1, min(len(points), _POINTS)).astype(int)]
    size = float(np.ptp(points, axis=0).max())
    for scale in _SCALES:
        if not 0.3 < scale * float(np.ptp(walls, axis=0).max()) / size < 20:
            continue
        for mirrored in (False, True):
            changed = _changed(walls, 0.0, scale, mirrored)
            turn, shift = _finer(few, changed, *_best_turn(few, changed))
            moved = (_changed(segments.reshape(-1, 2), turn, scale, mirrored) + shift).reshape(-1, 4)
            same = scale == 1.0 and not mirrored
            far = float(np.abs(moved - segments).max()) if same else np.inf
            yield MapPlacement(moved, _words(turn, scale, mirrored, shift), far < _HARDLY * size)


def _best_turn(points: FloatArray, walls: FloatArray) -> tuple[float, FloatArray]:
    """Return turn [rad] and shift (2,) [m] of the walls after which most points are near one."""
    middle = points.mean(axis=0)
    reach = max(float(np.abs(points - middle).max()), float(np.hypot(*(walls - walls.mean(axis=0)).T).max()))
    cell = 1.5 * reach / _CELLS
    seen = fft.rfft2(_raster(points - middle, cell))
    best = (-1.0, 0.0, np.zeros(2))
    for turn in _TURNS:
        turned = _changed(walls, turn, 1.0, False)
        centre = turned.mean(axis=0)
        field = gaussian_filter(np.minimum(_raster(turned - centre, cell), 1.0), 1.0)
        match = fft.irfft2(seen * np.conj(fft.rfft2(field)), s=field.shape)
        k = int(np.argmax(match))
        if match.flat[k] > best[0]:
            rows = np.array(np.unravel_index(k, match.shape), dtype=np.float64)
            rows = np.where(rows > np.array(match.shape) / 2, rows - np.array(match.shape), rows)
            best = float(match.flat[k]), float(turn), rows * cell + middle - centre
    return best[1:]


def _finer(points: FloatArray, walls: FloatArray, turn: float, shift: FloatArray) -> tuple[float, FloatArray]:
    """Return turn and shift after rounds of moving the walls towards the points nearest to them."""
    tree = cKDTree(walls)
    for _ in range(_ROUNDS):
        c, s = np.cos(turn), np.sin(turn)
        own = (points - shift) @ np.array([[c, -s], [s, c]])
        apart, index = tree.query(own)
        near = apart <= np.quantile(apart, _KEPT)
        a, b = walls[index[near]], points[near]
        ma, mb = a.mean(axis=0), b.mean(axis=0)
        h = (a - ma).T @ (b - mb)
        turn = float(np.arctan2(h[0, 1] - h[1, 0], h[0, 0] + h[1, 1]))
        shift = mb - _changed(ma[None, :], turn, 1.0, False)[0]
    return turn, shift


def _raster(points: FloatArray, cell: float) -> FloatArray:
    image = np.zeros((2 * _CELLS, 2 * _CELLS))
    index = np.clip(np.round(points / cell).astype(int) + _CELLS, 0, 2 * _CELLS - 1)
    np.add.at(image, (index[:, 0], index[:, 1]), 1.0)
    return image


def _along(segments: FloatArray) -> FloatArray:
    """Return points along the walls, (n, 2), so dense that they leave no gap in the raster."""
    length = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    step = max(float(np.ptp(segments.reshape(-1, 2), axis=0).max()) / (6 * _CELLS), 1e-6)
    parts = [
        row[:2] + np.linspace(0, 1, max(2, int(size / step)))[:, None] * (row[2:] - row[:2])
        for row, size in zip(segments, length, strict=True)
    ]
    return np.concatenate(parts)


def _changed(points: FloatArray, turn: float, scale: float, mirrored: bool) -> FloatArray:
    c, s = np.cos(turn), np.sin(turn)
    flipped = points * [1.0, -1.0] if mirrored else points
    return np.asarray(scale * flipped @ np.array([[c, s], [-s, c]]))


def _words(turn: float, scale: float, mirrored: bool, shift: FloatArray) -> str:
    degrees = (np.degrees(turn) + 180) % 360 - 180
    parts = ["mirrored (y to -y)"] if mirrored else []
    parts += [f"scaled by {scale:g}"] if scale != 1.0 else []
    parts += [f"turned by {degrees:.0f} deg"] if abs(degrees) > 1 else []
    parts += [f"shifted by ({shift[0]:.1f}, {shift[1]:.1f}) m"] if np.abs(shift).max() > 0.2 else []
    return f"the map does not fit the poses as given: it fits when {', '.join(parts) or 'moved a little'}"
