# SPDX-License-Identifier: BSD-3-Clause
"""From poses to readings: the generator's own laser, whole tours as arrays of scans by beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from kurumaisu.bench.hidden.generator import laws
from kurumaisu.bench.hidden.generator.motion import Fault
from kurumaisu.bench.hidden.generator.rays import NOTHING, cast
from kurumaisu.bench.hidden.generator.rooms import corners, edges
from kurumaisu.bench.hidden.generator.tours import Tour
from kurumaisu.types import FloatArray, IntArray

# The URG-04LX on the chair as the package's model file has it; typed here.
MOUNT = (0.30, 0.0, 0.0)  # [m], [m], [rad] base_from_laser
HEIGHT = 0.40  # [m] above the floor
ANGLE_MIN, ANGLE_STEP, BEAMS = -2.086214, 2 * np.pi / 1024, 682
BEAM_TIME = 0.1 / 1024  # [s]


@dataclass(frozen=True)
class Aim:
    """Where beams leave from in truth, and when: mount, tilt [rad], stamp errors, pace of the sweep, true corners."""

    mount: tuple[float, float, float]
    corners: FloatArray = field(repr=False)
    pitch: float = 0.0
    roll: float = 0.0
    late: float = 0.0
    skew: float = 0.0
    stretch: float = 0.0


@dataclass(frozen=True)
class Scans:
    """Scans (s,) by beams (b,) of a tour, and what becomes of them.

    ranges (s, b) [m], inf for nothing; cosine of the incidence; reflectance, normal (s, b, 2) and box of what
    was met;
    mean, sd [m]; unit noise; readings [m]. headings (s,) of base_link and temperature (s,) [deg C] at the stamps.
    """

    stamps: FloatArray
    leg: IntArray
    stop: IntArray
    bearings: FloatArray
    ranges: FloatArray
    cosine: FloatArray
    reflectance: FloatArray
    normal: FloatArray
    box: IntArray
    angles: FloatArray
    headings: FloatArray
    temperature: FloatArray
    mean: FloatArray
    sd: FloatArray
    unit: FloatArray
    readings: FloatArray


def bearings() -> FloatArray:
    """Return the bearings (682,) [rad] of the fan."""
    return ANGLE_MIN + ANGLE_STEP * np.arange(BEAMS)


def temperature(stamps: FloatArray) -> FloatArray:
    """Return the room's temperature [deg C]: heating that goes on and off, on a slow rise."""
    return np.asarray(21.0 + 3.0 * np.sin(2 * np.pi * stamps / 700.0) + 1.5 * np.sin(stamps / 2000.0))


def aimed(tour: Tour, faults: Sequence[Fault]) -> Aim:
    """Return the aim with the faults in it."""
    aim = Aim(MOUNT, corners(tour.room))
    for fault in faults:
        if fault.form.stage == "aim":
            aim = fault.form.act(aim, fault.sizes)
    return aim


def look(tour: Tour, aim: Aim, every: int = 1) -> Scans:
    """Return what the beams of every so-manieth scan meet, with means and deviations by equation (4)."""
    stamps = np.concatenate([leg.stamps[::every] for leg in tour.legs])
    legs = np.concatenate([np.full(len(leg.stamps[::every]), i) for i, leg in enumerate(tour.legs)])
    offset = np.cumsum([0, *(leg.stop[-1] + 1 for leg in tour.legs)])
    stops = np.concatenate([leg.stop[::every] + at for leg, at in zip(tour.legs, offset, strict=False)])
    delays = BEAM_TIME * (1 + aim.stretch) * np.arange(BEAMS)
    asked = stamps if tour.moving else stamps[_first(stops)]
    whose = legs if tour.moving else legs[_first(stops)]
    # A chair that stands needs one scan per stop.
    fired = (asked / (1 + aim.skew) - aim.late)[:, None] + (delays if tour.moving else 0 * delays)
    poses = np.concatenate([leg.poses(fired[whose == i]) for i, leg in enumerate(tour.legs)])
    beams, rise = _directions(aim)
    ranges, edge, cosine, angles = _cast(poses, aim, beams)
    level = np.cos(rise)
    with np.errstate(divide="ignore"):
        floor = np.where(rise < 0, HEIGHT / np.sin(np.maximum(-rise, 1e-12)), np.inf)
    ranges = np.minimum(ranges / level, floor)
    sides = edges(aim.corners)
    span = sides[:, 2:] - sides[:, :2]
    normals = np.stack([-span[:, 1], span[:, 0]], axis=1) / np.linalg.norm(span, axis=1, keepdims=True)
    shine = np.repeat([box.reflectance for box in tour.room], 4)
    spread = np.arange(len(stops)) if tour.moving else np.searchsorted(stops[_first(stops)], stops)
    ranges, edge, cosine, angles = ranges[spread], edge[spread], cosine[spread], angles[spread]
    seen = np.where(np.isfinite(ranges), ranges, 0.0)
    stamped = np.concatenate([leg.poses(leg.stamps[::every])[:, 2] for leg in tour.legs])
    return Scans(
        stamps,
        legs,
        stops,
        bearings(),
        ranges,
        cosine,
        np.where(edge == NOTHING, 1.0, shine[edge]),
        normals[edge],
        np.where(edge == NOTHING, NOTHING, edge // 4),
        angles,
        stamped,
        temperature(stamps),
        mean=laws.laser_mean(seen),
        sd=laws.laser_sd(seen),
        unit=np.zeros_like(ranges),
        readings=ranges,
    )


def expected(tour: Tour, faults: Sequence[Fault], every: int = 1) -> Scans:
    """Return scans whose means and deviations have the faults in them; nothing random is drawn."""
    scans = look(tour, aimed(tour, faults), every)
    for stage in ("bias", "sd"):
        scans = staged(scans, faults, stage)
    return scans


def read(scans: Scans, faults: Sequence[Fault]) -> FloatArray:
    """Return readings (s, b) of scans whose noise is drawn: outliers, rounding to 1 mm, gate; inf: no return."""
    scans = staged(scans, faults, "unit")
    hit = np.isfinite(scans.ranges)
    scans = replace(scans, readings=np.where(hit, scans.mean + scans.sd * scans.unit, np.inf))
    scans = staged(staged(scans, faults, "outlier"), faults, "grid")
    rounded = laws.LASER_STEP * np.rint(scans.readings / laws.LASER_STEP)
    gated = np.where(rounded > laws.LASER_FAR, np.inf, np.where(rounded < laws.LASER_NEAR, np.nan, rounded))
    return np.asarray(np.round(gated, 6))


def staged(scans: Scans, faults: Sequence[Fault], stage: str) -> Scans:
    """Return scans after the faults of one stage."""
    for fault in faults:
        if fault.form.stage == stage:
            scans = fault.form.act(scans, fault.sizes)
    return scans


def _first(stops: IntArray) -> IntArray:
    return np.unique(stops, return_index=True)[1]


def _directions(aim: Aim) -> tuple[FloatArray, FloatArray]:
    """Return bearings and elevations of the beams on a level chair."""
    flat = bearings()
    if aim.pitch == 0 and aim.roll == 0:
        return flat, np.zeros(BEAMS)
    beams = np.stack([np.cos(flat), np.sin(flat), np.zeros(BEAMS)], axis=1)
    x, y, z = Rotation.from_euler("xy", [aim.roll, aim.pitch]).apply(beams).T
    return np.unwrap(np.arctan2(y, x)), np.arcsin(z)


def _cast(poses: FloatArray, aim: Aim, beams: FloatArray) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
    """Return ranges, edges, cosines and directions (s, b) of beams from poses (s, b, 3) of base_link."""
    x, y, yaw = aim.mount
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    origins = np.stack([poses[..., 0] + c * x - s * y, poses[..., 1] + s * x + c * y], axis=-1)
    angles = poses[..., 2] + yaw + beams
    hits = cast(origins.reshape(-1, 2), angles.ravel(), edges(aim.corners))
    shape = angles.shape
    return hits.ranges.reshape(shape), hits.edge.reshape(shape), hits.cosine.reshape(shape), angles
