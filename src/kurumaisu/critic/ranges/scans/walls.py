# SPDX-License-Identifier: BSD-3-Clause
"""The walls that level beams meet, and the rays that meet them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world import World
from kurumaisu.world.layout import outline, travels

_WHOLE = 0.02  # [pixels] that a border's length may differ from a whole number
_MOST_APART = 16  # [pixels] that the shortest border may have
_NEAR = 1.0  # [pixels] from a line within which borders belong to it: those of a straight wall do
_STRAIGHT = 0.8  # [pixels] likewise, of the one line that fits best: half a pixel's diagonal, and what rounds
_FEWEST = 3  # borders to which a line is fitted
_THIN = 4  # [pixels] of a wall, at most, of which the end is kept as it is
_CORNER = 2  # borders at each end that may belong to the next line
_CROSS = np.sin(np.radians(15.0))  # lines that meet more sharply have their corner where they cross
_APART = 4.0  # [pixels] of that from the borders, at most, and half of the shorter line's borders


class Line(NamedTuple):
    """A line along so many borders: a point (2,) of it, and its direction (2,)."""

    base: FloatArray
    way: FloatArray
    borders: int


def straightened(segments: FloatArray) -> FloatArray:
    """Return closed outlines (n, 4) [m] with straight lines in place of stairs of pixels; others as they are.

    segments (m, 4): borders between pixels, runs joined, as world.bitmaps has them, turned and scaled in any way.
    """
    if not len(segments):
        return segments
    way = segments[0, 2:] - segments[0, :2]
    c, s = way / np.hypot(*way)
    turn = np.array([[c, -s], [s, c]])
    points = segments.reshape(-1, 2) @ turn
    steps = np.abs(points[1::2] - points[::2])
    upright = steps[:, 1] > steps[:, 0]
    pixel = np.array([_pixel(steps[~upright, 0]), _pixel(steps[upright, 1])])
    if not (pixel > 0).all():
        return segments
    corner = points.min(axis=0)
    cells = np.rint((points - corner) / pixel).astype(np.int64)
    loops = [(loop, _sizes(loop)) for loop in _loops(cells.reshape(-1, 4))]
    if not any((_stairs(loop) & (sizes == 1)).any() for loop, sizes in loops):
        return segments
    lines = [_lines(loop) for loop, _ in loops]
    ends = np.concatenate([np.hstack([each, np.roll(each, -1, axis=0)]) for each in lines])
    return np.asarray(((ends.reshape(-1, 2) * pixel + corner) @ turn.T).reshape(-1, 4))


def _pixel(lengths: FloatArray) -> float:
    """Return the edge of a pixel [m] of which borders (n,) [m] along an axis are whole multiples; 0: there is none."""
    shortest = float(lengths.min(initial=np.inf))
    for parts in range(1, _MOST_APART + 1):
        whole = lengths * parts / shortest
        if np.isfinite(shortest) and np.abs(whole - np.rint(whole)).max() < _WHOLE:
            return shortest / parts
    return 0.0


def _loops(borders: IntArray) -> Iterator[IntArray]:
    """Yield the corners (k, 2) of each closed outline, in order; borders (m, 4): from and to."""
    after: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for ax, ay, bx, by in borders.tolist():
        after.setdefault((ax, ay), []).append((bx, by))
    while after:
        at = next(iter(after))
        loop = []
        while at in after:
            loop.append(at)
            ends = after[at]
            following = ends.pop()
            if not ends:
                del after[at]
            at = following
        yield np.array(loop)


def _sizes(loop: IntArray) -> IntArray:
    """Return the length [pixels] of each border (k,) of an outline with corners (k, 2)."""
    return np.asarray(np.abs(np.roll(loop, -1, axis=0) - loop).sum(axis=1))


def _stairs(loop: IntArray) -> BoolArray:
    """Return at which borders (k,) the outline turns back to where it went before: a step of stairs."""
    way = np.roll(loop, -1, axis=0) - loop
    after = np.roll(way, -1, axis=0)
    left = way[:, 0] * after[:, 1] - way[:, 1] * after[:, 0] > 0  # at the end of each border
    return np.asarray(left != np.roll(left, 1))


def _lines(loop: IntArray) -> FloatArray:
    """Return the corners (n, 2) [pixels] of straight lines along an outline of pixels, its corners (k, 2)."""
    sizes, stairs = _sizes(loop), _stairs(loop)
    if not (stairs & (sizes == 1)).any():
        return loop.astype(np.float64)
    points, corners = _along(loop, sizes, ~stairs & (sizes <= _THIN))
    spans = list(pairwise(_joined(points, _split(points, corners), corners)))
    if len(spans) < 3:
        return loop.astype(np.float64)
    lines = [_line(points[a : b + 1]) for a, b in spans]
    kept = [i for i, (a, b) in enumerate(spans) if not _cuts_corner(lines, i, (points[a] + points[b]) / 2)]
    return np.array([_meeting(lines[kept[k - 1]], lines[i], points[spans[i][0]]) for k, i in enumerate(kept)])


def _cuts_corner(lines: Sequence[Line], i: int, middle: FloatArray) -> bool:
    """Return whether a short line stands between two long ones that meet in one place, near its middle (2,)."""
    before, after = lines[i - 1], lines[(i + 1) % len(lines)]
    short = [line.borders <= 2 * _CORNER for line in (before, lines[i], after)]
    return short == [False, True, False] and _crossing(before, after, middle) is not None


def _along(loop: IntArray, sizes: IntArray, caps: BoolArray) -> tuple[FloatArray, list[int]]:
    """Return the middles of an outline's pixels' borders, closed, with the ends (n, 2) of caps, and indices of those.

    A cap, where a thin wall ends, would else be taken for a step.
    """
    corners = caps | np.roll(caps, 1)
    if corners.any():
        first = int(np.argmax(corners))
    else:
        first = int(np.argmax(np.square(loop - loop.mean(axis=0)).sum(axis=1)))
    loop, sizes, corners = np.roll(loop, -first, axis=0), np.roll(sizes, -first), np.roll(corners, -first)
    points: list[FloatArray] = []
    ends = []
    for corner, size, step, end in zip(loop, sizes, np.roll(loop, -1, axis=0) - loop, corners, strict=True):
        if end:
            ends.append(len(points))
            points.append(corner.astype(np.float64))
        points += list(corner + (np.arange(size)[:, np.newaxis] + 0.5) / size * step)
    return np.array([*points, points[0]]), ends


def _split(points: FloatArray, corners: list[int]) -> list[int]:
    """Return the indices of points (n, 2), a closed outline, from which no other is far off the line between them.

    corners: indices of some of them.
    """
    far = int(np.argmax(np.square(points - points[0]).sum(axis=1)))
    ends = {0, *(corners if len(corners) > 1 else (far,)), len(points) - 1}
    todo = list(pairwise(sorted(ends)))
    while todo:
        a, b = todo.pop()
        if b - a < 2:
            continue
        way = points[b] - points[a]
        off = points[a + 1 : b] - points[a]
        away = np.abs(off[:, 0] * way[1] - off[:, 1] * way[0]) / max(float(np.hypot(*way)), 1.0)
        worst = a + 1 + int(np.argmax(away))
        if away.max() > _NEAR:
            ends.add(worst)
            todo += [(a, worst), (worst, b)]
    return sorted(ends)


def _joined(points: FloatArray, ends: list[int], corners: list[int]) -> list[int]:
    """Return those of the ends, indices of points (n, 2), between which lie different lines; corners: those that stay.

    A line from one border to another is not the line along all of them.
    """
    at = 1
    while at < len(ends) - 1:
        if ends[at] not in corners and _along_one(points[ends[at - 1] : ends[at + 1] + 1]) is not None:
            del ends[at]
            at = max(at - 1, 1)
        else:
            at += 1
    return ends


def _along_one(points: FloatArray) -> Line | None:
    """Return the line along points (n, 2), None where they lie along several; the first and last ones do not count."""
    inner = points[_CORNER : len(points) - _CORNER]
    if len(inner) < _FEWEST:
        return None
    middle = inner.mean(axis=0)
    way = np.linalg.svd(inner - middle, full_matrices=False)[2][0]
    off = inner - middle
    away = np.abs(off[:, 0] * way[1] - off[:, 1] * way[0])
    return Line(middle, way, len(points) - 1) if away.max() < _STRAIGHT else None


def _line(points: FloatArray) -> Line:
    """Return the line along points (n, 2), or from the first to the last."""
    way = points[-1] - points[0]
    return _along_one(points) or Line(points[0], way / np.hypot(*way), len(points) - 1)


def _crossing(one: Line, other: Line, near: FloatArray) -> FloatArray | None:
    """Return where two lines cross (2,), None unless that is sharply, and near a place (2,)."""
    cross = one.way[0] * other.way[1] - one.way[1] * other.way[0]
    if abs(cross) < _CROSS:
        return None
    between = other.base - one.base
    corner = one.base + one.way * (between[0] * other.way[1] - between[1] * other.way[0]) / cross
    apart = min(_APART, 0.5 * min(one.borders, other.borders))
    return np.asarray(corner) if np.hypot(*(corner - near)) < apart else None


def _meeting(one: Line, other: Line, border: FloatArray) -> FloatArray:
    """Return the corner (2,) of two lines that meet near a border's middle (2,): at least on the longer one."""
    corner = _crossing(one, other, border)
    if corner is not None:
        return corner
    longer = max(one, other, key=lambda line: line.borders)
    return np.asarray(longer.base + longer.way * ((border - longer.base) @ longer.way))


@dataclass(frozen=True)
class Walls:
    """Walls at the height of a laser: segments (m, 4), x and y of both ends [m]; returns (m,): reflectance of each.

    drawn: the same as a map of pixels has them, askew ones as stairs; None: it has none, or it is known which they are.
    stairs: whether most of what might be straight are stairs.
    """

    segments: FloatArray
    returns: FloatArray
    drawn: Walls | None = None
    stairs: bool = False


def walls_at(world: World, height: float) -> Walls:
    """Return what a laser at a height [m] sees of a world, without what drives or walks."""
    lines, borders, returns = [np.empty((0, 4))], [np.empty((0, 4))], []
    for model in world.models:
        if model.ranger_return >= 0 and not travels(model, world.models):
            border = outline(model, world.poses[model.index])
            borders.append(border[(border[:, 4] <= height) & (border[:, 5] >= height), :4])
            lines.append(borders[-1] if model.shape.polygons else straightened(borders[-1]))
            returns.append(model.ranger_return)
    straight, drawn = (
        Walls(np.concatenate(each), np.repeat(returns, [len(part) for part in each[1:]])) for each in (lines, borders)
    )
    return straight if np.array_equal(straight.segments, drawn.segments) else replace(straight, drawn=drawn)


class Rays:
    """Casts rays against walls."""

    def __init__(self, walls: Walls) -> None:
        order = np.argsort(walls.returns, kind="stable")  # where walls coincide, the first one counts: the darkest
        self._scene = Scene(walls.segments[order])
        self._returns = np.append(walls.returns[order], 1.0)  # the last: of nothing

    def ranges(self, poses: FloatArray, bearings: FloatArray) -> FloatArray:
        """Return ranges (n,) [m] of beams from poses (n, 3) along bearings (n,) [rad]; +inf: nothing there."""
        return self._scene.cast(poses, bearings, np.inf)

    def cast(self, poses: FloatArray, bearings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ranges as above, and the reflectance (n,) of what is met; 1 where that is nothing."""
        ranges, met = self._scene.meet(poses, bearings)
        return ranges, self._returns[met]
