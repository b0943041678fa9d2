# SPDX-License-Identifier: BSD-3-Clause
"""Scans against the map: which reading of fan, clock or map makes them agree."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from kurumaisu import geometry
from kurumaisu._core import Scene
from kurumaisu.critic.ranges.scans.map_changes import FEW, changed_places
from kurumaisu.critic.ranges.scans.valid_readings import without_cut_off
from kurumaisu.critic.values.recording import LaserMount, Series
from kurumaisu.types import FloatArray

_SCANS, _BEAMS = 40, 120  # that are looked at
_FAR = 100.0  # [m]
_FEWEST = 5  # readings of a scan, up to which it says nothing
_TOLERANCE = (0.15, 0.03)  # [m] and share of the range: an error of pose, mounting or range that is no other world
_GOOD = 0.8  # share of readings that agree, from which nothing is said
_HALF = 0.4  # share from which nothing is said unless another reading agrees better
_WIN = 0.15  # share by which another reading of the data must agree better
_AGREES = 0.6  # least share for a reading that is said
_ASIDE = np.radians(12.0)  # a smaller turn is an error of the mounting or of the poses, not of the data
_ASTRAY = np.arange(-0.2, 0.25, 0.1)  # [m] from where a laser is said to be mounted
_ALIKE = 0.02  # share by which two readings of the data hardly differ
_MOVED = 0.75  # least share for a map that was moved
_MANY = 6  # readings of a place, at least, which says whether there is something else
_SHIFTS = np.setdiff1d(np.arange(-30.0, 30.5, 0.5), [0.0])  # [s]
_DRIFTS = np.arange(-5.0, 5.05, 0.1)  # [s] by which a clock may be off at the end of the recording
CLOCKS = "clocks of scans and poses differ"
_CELLS = 128  # on either side of the middle
_TURNS = np.radians(np.arange(0, 360, 6))
_SCALES = (1.0, 0.5, 2.0, 0.1, 10.0, 0.01, 100.0, 1e-3, 1e3)
_POINTS = 1500  # that are fitted
_HARDLY = 0.05  # share of the size of what is seen, by which a map may move: poses or mounting are a little off
_ROUNDS = 25
_KEPT = 0.7  # share of the points that are nearest to a wall, in the fit


@dataclass(frozen=True)
class _View:
    """Thinned scans: times (k,) [s], bearings (b,) [rad] in the laser's frame, ranges (k, b) [m], none cut off."""

    times: FloatArray
    bearings: FloatArray
    ranges: FloatArray


def problem(scan: Series, pose: Series, laser: LaserMount, segments: FloatArray, mean_error: FloatArray) -> str | None:
    """Return what is wrong with scans, mounting or map, None where they agree or too little is seen.

    segments (m, 4) [m] of the map; mean_error: slope and offset [m] of a reading of a range, (2,).
    """
    view = _thinned(scan, pose, laser, mean_error)
    if len(view.times) < 3 or np.isfinite(view.ranges).mean() < 0.02:
        return None
    check = _Check(_scene(segments), pose, laser)
    plain = check.agreement(view)
    if plain > _GOOD:
        return None
    found = max(_readings(check, view), key=lambda pair: pair[0], default=(0.0, ""))
    if found[0] < max(_AGREES, plain + _WIN):
        found = max(found, _moved(check, view, segments), key=lambda pair: pair[0])
    share = f"as given {plain:.0%} of the readings match a wall of the map"
    if _mounted(check, view) > max(_GOOD, found[0] - _ALIKE):
        return None
    if plain > _HALF and found[0] < plain + _WIN:
        other = check.elsewhere(view)
        if other < FEW:
            return None
        return (
            f"scans do not match the map: {share}, and {other:.0%} come, from whichever place they are taken, from "
            f"objects that are not in it: another place, or a map of another day?"
        )
    if found[0] > max(_AGREES, plain + _WIN):
        return f"{found[1]}; {share}, then {found[0]:.0%}"
    return (
        f"scans do not match the map: {share}, and no rotation, shift, mirroring or scale corrects it: another place?"
    )


def drifts(
    runs: Sequence[tuple[Series, Series]], laser: LaserMount, segments: FloatArray, mean_error: FloatArray, zero: float
) -> bool:
    """Tell whether a clock that runs fast or slow explains the scans of several runs, as no other shift of it does.

    runs: scans and poses of each; zero [s]: when the clocks agreed. A run alone may look shifted then, by its drift.
    """
    scene = _scene(segments)
    parts = [(_Check(scene, pose, laser), _thinned(scan, pose, laser, mean_error)) for scan, pose in runs]
    span = max(float(scan.t[-1]) for scan, _ in runs) - zero

    def best(by: Callable[[FloatArray], FloatArray]) -> float:
        """Return how well the scans agree with the map at best, each as much later as `by` has it of a clock's."""
        shares = [
            np.mean([check.agreement(replace(view, times=view.times + off * by(view.times))) for check, view in parts])
            for off in _DRIFTS
        ]
        return float(np.max(shares))

    drift = best(lambda times: (times - zero) / span)
    return drift > _GOOD and drift > best(np.ones_like) + _ALIKE


def _mounted(check: _Check, view: _View) -> float:
    """Return how well the scans agree with the map from a laser that is a little elsewhere on the chair.

    That is an error of the mounting, which the catalogue has, though from few places another clock may do the same.
    """
    places = [replace(check.laser, x=check.laser.x + x, y=check.laser.y + y) for x in _ASTRAY for y in _ASTRAY]
    return max(_Check(check.scene, check.pose, laser).agreement(view) for laser in places)


def _moved(check: _Check, view: _View, segments: FloatArray) -> tuple[float, str]:
    """Return how well the scans agree with the map moved, and the words for it."""
    best = (0.0, "")
    for fitted in nearest_maps(check.points(view), segments):
        if fitted.small:
            continue
        best = max(best, (_Check(_scene(fitted.segments), check.pose, check.laser).agreement(view), fitted.words))
        if best[0] > _MOVED:
            return best
    return (0.0, "")  # among so many places some fits by chance


def _scene(segments: FloatArray) -> Scene:
    return Scene(np.ascontiguousarray(segments))


@dataclass(frozen=True)
class _Check:
    """How well scans agree with a map from given poses."""

    scene: Scene
    pose: Series
    laser: LaserMount

    def origins(self, times: FloatArray) -> FloatArray:
        """Return where the laser is in the map, (k, 3)."""
        base = geometry.interpolate(self.pose.t, self.pose.values[:, :3], times)
        return geometry.compose(base, np.array([self.laser.x, self.laser.y, self.laser.yaw]))

    def agreement(self, view: _View) -> float:
        """Return the share of the readings that are about where the map has a wall, the mean over the scans."""
        return float(np.nanmean(agree(view.ranges, self._expected(self.origins(view.times), view))))

    def elsewhere(self, view: _View) -> float:
        """Return the share of the readings that are, from wherever they are taken, of something else than the map's."""
        origins = self.origins(view.times)
        ranges, expected = view.ranges, self._expected(origins, view)
        found, _ = changed_places(ranges, expected, _ends(origins, view, expected), many=_MANY, either=True)
        return float(found.sum() / max(np.isfinite(ranges).sum(), 1))

    def _expected(self, origins: FloatArray, view: _View) -> FloatArray:
        """Return the ranges (k, b) [m] to the map's walls from origins (k, 3)."""
        return np.stack([self.scene.cast(origin, view.bearings, _FAR) for origin in origins])

    def points(self, view: _View) -> FloatArray:
        """Return where the readings end in the map's frame, (n, 2) [m]."""
        return np.asarray(_ends(self.origins(view.times), view, view.ranges)[np.isfinite(view.ranges)])


def _ends(origins: FloatArray, view: _View, ranges: FloatArray) -> FloatArray:
    """Return where beams of such ranges (k, b) [m] from origins (k, 3) end in the map's frame, (k, b, 2) [m]."""
    angles = origins[:, 2:3] + view.bearings
    way = ranges[:, :, np.newaxis] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.asarray(origins[:, np.newaxis, :2] + way)


def agree(measured: FloatArray, expected: FloatArray) -> FloatArray:
    """Return per scan the share of its readings that are as expected, nan for a scan without readings."""
    known = np.isfinite(measured)
    near = np.abs(np.where(known, measured, 0.0) - expected) < _TOLERANCE[0] + _TOLERANCE[1] * np.where(
        known, measured, 0.0
    )
    number = known.sum(axis=1)
    return np.where(number > _FEWEST, (near & known).sum(axis=1) / np.maximum(number, 1), np.nan)


def _thinned(scan: Series, pose: Series, laser: LaserMount, mean_error: FloatArray) -> _View:
    inside = np.flatnonzero((scan.t >= pose.t[0]) & (scan.t <= pose.t[-1]))
    few = inside[np.unique(np.linspace(0, len(inside) - 1, _SCANS).astype(int))] if len(inside) else inside
    beams = np.unique(np.linspace(0, scan.values.shape[1] - 1, _BEAMS).astype(int))
    ranges = (without_cut_off(scan.values[np.ix_(few, beams)]) - mean_error[1]) / mean_error[0]
    ranges = np.where(np.isfinite(ranges) & (ranges > 0), ranges, np.nan)
    seen = np.isfinite(ranges).sum(axis=1) > _FEWEST
    return _View(scan.t[few][seen], laser.angle_min + laser.angle_increment * beams, ranges[seen])


def _readings(check: _Check, view: _View) -> Iterator[tuple[float, str]]:
    """Yield how well the scans agree when they are read otherwise, and the words for it."""
    yield from _scaled(check, view)
    yield from _turned(check, view)
    yield from _fans(check, view)
    yield from _late(check, view)
    yield from _shuffled(check, view)


def _scaled(check: _Check, view: _View) -> Iterator[tuple[float, str]]:
    for factor, name in (
        (1e-3, "millimetres"),
        (1e-2, "centimetres"),
        (0.0254, "inches"),
        (0.3048, "feet"),
        (1e3, "kilometres"),
    ):
        other = replace(view, ranges=view.ranges * factor)
        yield check.agreement(other), f"ranges look like {name}: try {factor:g} * r"


def _turned(check: _Check, view: _View) -> Iterator[tuple[float, str]]:
    """Try the beams as they are and reversed, from any first angle."""
    middle = (view.bearings[0] + view.bearings[-1]) / 2
    for mirrored in (False, True):
        bearings = 2 * middle - view.bearings if mirrored else view.bearings
        best = (0.0, 0.0)
        for by in np.radians(np.arange(-180, 180, 3)):
            best = max(best, (check.agreement(replace(view, bearings=bearings + by)), float(by)))
        by = best[1]
        for fine in np.radians(np.arange(-2, 2.5, 1)):
            best = max(best, (check.agreement(replace(view, bearings=bearings + by + fine)), float(by + fine)))
        degrees = np.degrees(best[1])
        turn = f"the laser is turned by {degrees:.0f} deg: try angle_min or yaw {best[1]:+.3g}"
        if not mirrored and abs(by) > _ASIDE:
            yield best[0], turn
        elif not mirrored:
            continue  # an error of the mounting, which the catalogue has
        else:
            also = f", and {turn}" if abs(degrees) > 4 else ""
            yield best[0], f"beams are counted the other way round (clockwise): try r reversed{also}"


def _fans(check: _Check, view: _View) -> Iterator[tuple[float, str]]:
    """Try fans of other sensors: so many degrees, ahead in the middle."""
    for span in (90, 180, 190, 240, 270, 360):
        bearings = np.radians(np.linspace(-span / 2, span / 2, len(view.bearings)))
        yield (
            check.agreement(replace(view, bearings=bearings)),
            f"the beams look like a scan of {span} deg: another sensor?",
        )


def _late(check: _Check, view: _View) -> Iterator[tuple[float, str]]:
    first, last = check.pose.t[0], check.pose.t[-1]
    for by in _SHIFTS:
        inside = (view.times + by >= first) & (view.times + by <= last)
        if inside.sum() > 0.5 * len(view.times):
            other = _View(view.times[inside] + by, view.bearings, view.ranges[inside])
            yield check.agreement(other), f"{CLOCKS}: try t of the scans {by:+.3g} s"


def _shuffled(check: _Check, view: _View) -> Iterator[tuple[float, str]]:
    """Try each scan at every place of the drive."""
    places = np.linspace(check.pose.t[0], check.pose.t[-1], 150)
    origins = check.origins(places)
    expected = [check.scene.cast(origin, view.bearings, _FAR) for origin in origins]
    best = np.array([agree(view.ranges, np.tile(row, (len(view.ranges), 1))) for row in expected])
    share = np.nanmax(best, axis=0)
    at = places[np.nanargmax(np.nan_to_num(best, nan=-1.0), axis=0)]
    apart = float(np.median(np.abs(at - view.times)))
    yield (
        0.9 * float(np.nanmean(share)),
        (f"scans are in another order than their times: each fits a place {apart:.3g} s away (median)"),
    )


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
