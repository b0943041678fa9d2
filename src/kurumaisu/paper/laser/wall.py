# SPDX-License-Identifier: BSD-3-Clause
"""Scans of a flat wall at known distances: what figures 7, 8 and 9 show of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.errors import Error
from kurumaisu.paper.options import Wall
from kurumaisu.params import Laser
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class WallScans:
    """Scans at one distance [m] of a wall.

    ranges: (scans, beams) [m], nan and inf where there is no reading; bearings (beams,) [rad] from straight ahead;
    turned [rad]: the wall's normal, seen from straight ahead.
    """

    distance: float
    ranges: FloatArray
    bearings: FloatArray
    turned: float

    @property
    def points(self) -> FloatArray:
        """Return all scans in Cartesian coordinates, (scans, beams, 2) [m], x ahead."""
        ahead = np.stack([np.cos(self.bearings), np.sin(self.bearings)], axis=-1)
        ranges = np.where(np.isfinite(self.ranges), self.ranges, np.nan)
        return np.asarray(ranges[..., np.newaxis] * ahead)


@dataclass(frozen=True)
class Ahead:
    """The beams ahead at one distance.

    true: (beams,) their true ranges [m]; readings: (scans, beams) [m], all finite; mean, sd [m]: of a reading, over
    scans, each beam about its own mean; flat_mean, flat_sd: x of all points on the wall, pooled over beams and scans.
    """

    distance: float
    true: FloatArray
    readings: FloatArray
    mean: float
    sd: float
    flat_mean: float
    flat_sd: float


def places_of(recording: Recording, distances: Sequence[float], laser: Laser, options: Wall) -> list[WallScans]:
    """Return the places of a recording: a run with scans for each distance [m], in the order of their names.

    laser: the model's, for a recording that does not state its fan. Raise Error naming the run and what is wrong.
    """
    runs = [run for run in recording.runs if run.scan is not None]
    if len(runs) != len(distances):
        names = ", ".join(run.name for run in runs) or "none"
        raise Error(f"{recording.name}: {len(distances)} distances, {len(runs)} runs with scans: {names}")
    return [_place(recording, run, d, laser, options) for run, d in zip(runs, distances, strict=True)]


def _place(recording: Recording, run: Run, distance: float, laser: Laser, options: Wall) -> WallScans:
    assert run.scan is not None
    fan = run.fan or recording.laser or laser
    ranges = run.scan.values
    if len(ranges) < options.least_scans:
        raise Error(f"{run.name}: {len(ranges)} scans at {distance:g} m, {options.least_scans} are needed")
    bearings = fan.angle_min + fan.angle_increment * np.arange(ranges.shape[1])
    place = WallScans(distance, ranges, bearings, 0.0)
    turned = _turned(place, options)
    if abs(turned) > options.square:
        raise Error(f"{run.name}: the wall is turned by {np.degrees(turned):.1f} degrees; put it square to the laser")
    return WallScans(distance, ranges, bearings, turned)


def _turned(place: WallScans, options: Wall) -> float:
    """Return the direction of the wall's normal [rad] by a line through the points about straight ahead."""
    near = np.abs(place.bearings) < 2 * options.ahead
    points = place.points[:, near].mean(axis=0)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 3:
        why = "they lie beyond the sensor's limits" if np.isinf(place.ranges[:, near]).any() else "there are none"
        raise Error(f"no readings straight ahead at {place.distance:g} m: {why}")
    slope = np.polyfit(points[:, 1], points[:, 0], 1)[0]
    return float(np.arctan(-slope))


def on_wall(place: WallScans, options: Wall) -> FloatArray:
    """Return the points on the wall, (n, 2) [m]: those connected to straight ahead, at the wall's distance."""
    points = place.points
    middle = float(np.nanmedian(points[:, np.abs(place.bearings) < options.ahead, 0]))
    mean = np.where(np.isfinite(points[..., 0]).all(axis=0), points[..., 0].mean(axis=0), np.inf)
    flat = np.abs(mean - middle) < options.depth
    front = int(np.argmin(np.abs(place.bearings)))
    off = np.flatnonzero(~flat)
    first = max((int(i) + 1 for i in off if i < front), default=0)
    last = min((int(i) for i in off if i > front), default=len(flat))
    return np.asarray(points[:, first:last].reshape(-1, 2))


def ahead_of(place: WallScans, options: Wall) -> Ahead:
    """Return mean and standard deviation at a distance. Raise Error where beams ahead have no readings."""
    near = np.abs(place.bearings) < options.ahead
    readings = place.ranges[:, near]
    whole = np.isfinite(readings).all(axis=0)
    if whole.sum() < 0.9 * near.sum():
        raise Error(f"at {place.distance:g} m {near.sum() - whole.sum()} of {near.sum()} beams ahead lack readings")
    readings = readings[:, whole]
    true = place.distance / np.cos(place.bearings[near][whole] - place.turned)
    flat = on_wall(place, options)[:, 0]
    return Ahead(
        place.distance,
        true,
        readings,
        float(readings.mean()),
        float(np.sqrt(readings.var(axis=0, ddof=1).mean())),
        float(flat.mean()),
        float(flat.std(ddof=1)),
    )
