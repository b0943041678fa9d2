# SPDX-License-Identifier: BSD-3-Clause
"""Scans of a made-up place, by a ray caster of its own, and the ways in which scans and maps go wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from kurumaisu.bench.critic.drives import Tables
from kurumaisu.critic.values.recording import LaserMount
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

MOUNT = LaserMount(0.3, 0.0, 0.0, -2.086214, 4 * 0.006135923, 171)
_MOST = 4.0  # [m]


@dataclass(frozen=True)
class Sight:
    """scans (k, 1 + beams) of t and ranges; walls (m, 4) of the map that is given; laser as meta.yaml says it."""

    scans: FloatArray
    walls: FloatArray
    laser: LaserMount


def place(rng: np.random.Generator, middle: FloatArray) -> FloatArray:
    """Return the walls (m, 4) [m] of rooms and furniture about a point."""
    lines: list[tuple[float, float, float, float]] = []
    xs, ys = (np.cumsum(rng.uniform(2.5, 6, 8)) for _ in range(2))
    xs, ys = xs - xs[4] + middle[0], ys - ys[4] + middle[1]
    for line, cross, upright in ((xs, ys, True), (ys, xs, False)):
        for at in line:
            for a, b in pairwise(cross):
                door = rng.uniform(0.2, 0.8) * (b - a) + a
                for p, q in ((a, max(a, door - 0.5)), (min(b, door + 0.5), b)):
                    lines.append((at, p, at, q) if upright else (p, at, q, at))
    for _ in range(40):
        x, y = rng.uniform(xs[0], xs[-1]), rng.uniform(ys[0], ys[-1])
        a, size = rng.uniform(0, np.pi), rng.uniform(0.3, 1.5)
        lines.append((x, y, x + size * np.cos(a), y + size * np.sin(a)))
    return np.array(lines)


def look(tables: Tables, rng: np.random.Generator, off: FloatArray, noise: float) -> Sight:
    """Return scans of a drive at 5 Hz; off: how the mounting differs in truth [m, m, rad]; noise sd [m]."""
    truth = tables["truth"][:: round(0.2 / 0.005)]
    walls = place(rng, truth[:, 1:3].mean(axis=0))
    rows = []
    bearings = MOUNT.angle_min + MOUNT.angle_increment * np.arange(MOUNT.beams)
    for _, x, y, theta in truth:
        at = (x + 0.3 * np.cos(theta) + off[0], y + 0.3 * np.sin(theta) + off[1])
        rows.append(_cast(walls, at, theta + off[2] + bearings))
    ranges = np.array(rows)
    ranges = 1.004587 * ranges + 0.058826 + noise * rng.standard_normal(ranges.shape)
    ranges[ranges > _MOST] = np.inf
    ranges[rng.random(ranges.shape) < 0.05] = np.nan
    return Sight(np.column_stack([truth[:, 0], np.round(ranges, 3)]), walls, MOUNT)


def _cast(walls: FloatArray, at: tuple[float, float], angles: FloatArray) -> FloatArray:
    """Return ranges (b,) by cutting every ray with every wall's line."""
    d = np.stack([np.cos(angles), np.sin(angles)])
    p, e = walls[:, :2] - np.array(at), walls[:, 2:] - walls[:, :2]
    cross = d[0][:, None] * e[:, 1] - d[1][:, None] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (p[:, 0] * e[:, 1] - p[:, 1] * e[:, 0]) / cross
        part = (p[:, 0] * d[1][:, None] - p[:, 1] * d[0][:, None]) / cross
    hit = (along > 0) & (part >= 0) & (part <= 1)
    return np.asarray(np.where(hit, along, np.inf).min(axis=1))


def write_world(path: Path, walls: FloatArray) -> None:
    """Write walls as a Stage world of thin boxes."""
    lines = ["define wall model ( gui_move 0 )"]
    for x0, y0, x1, y1 in walls:
        size = float(np.hypot(x1 - x0, y1 - y0))
        angle = np.degrees(np.arctan2(y1 - y0, x1 - x0))
        if size > 0.01:
            where = f"pose [{(x0 + x1) / 2:.6f} {(y0 + y1) / 2:.6f} 0 {angle:.6f}] size [{size:.6f} 0.01 1.0]"
            lines.append(f"wall ( {where} )")
    write_whole({path: "\n".join(lines) + "\n"})


_Spoil = Callable[[Sight, np.random.Generator], Sight]


def _ranges(change: Callable[[FloatArray, np.random.Generator], FloatArray]) -> _Spoil:
    return lambda s, rng: replace(s, scans=np.column_stack([s.scans[:, 0], change(s.scans[:, 1:], rng)]))


def _laser(change: Callable[[LaserMount], LaserMount]) -> _Spoil:
    return lambda s, _: replace(s, laser=change(s.laser))


def _walls(change: Callable[[FloatArray, np.random.Generator], FloatArray]) -> _Spoil:
    return lambda s, rng: replace(s, walls=change(s.walls.reshape(-1, 2), rng).reshape(-1, 4))


def _turned(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    a = rng.uniform(0.3, 2 * np.pi - 0.3)
    return np.asarray(points @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]))


def _late(s: Sight, rng: np.random.Generator) -> Sight:
    by = rng.uniform(2, 8) * rng.choice([-1, 1])
    return replace(s, scans=s.scans + np.r_[by, np.zeros(s.scans.shape[1] - 1)])


def _elsewhere(s: Sight, rng: np.random.Generator) -> Sight:
    return replace(s, walls=place(rng, s.walls.reshape(-1, 2).mean(axis=0)))


def _rebuilt(s: Sight, rng: np.random.Generator) -> Sight:
    """Move all walls that run along y."""
    upright = s.walls[:, 0] == s.walls[:, 2]
    by = rng.uniform(0.5, 1.0) * rng.choice([-1, 1])
    return replace(s, walls=s.walls + np.where(upright[:, np.newaxis], [by, 0.0, by, 0.0], 0.0))


SPOILT: dict[str, tuple[_Spoil, str]] = {
    "another building": (_elsewhere, "do not match the map"),
    "map before the house was rebuilt": (_rebuilt, "map"),
    "map shifted": (_walls(lambda p, r: p + r.uniform(1.0, 4.0, 2) * r.choice([-1, 1], 2)), "shifted"),
    "map turned": (_walls(_turned), "turned"),
    "map mirrored": (_walls(lambda p, _: p * [1, -1]), "mirrored"),
    "map scaled": (_walls(lambda p, r: p * r.choice([0.1, 0.5, 2.0, 10.0])), "scaled"),
    "beams reversed": (_ranges(lambda r, _: r[:, ::-1]), "other way round"),
    "laser at 180 deg": (_laser(lambda m: replace(m, yaw=np.pi)), "the laser is turned by"),
    "angle_min off by half the fan": (_laser(lambda m: replace(m, angle_min=0.0)), "the laser is turned by"),
    "fan in degrees": (
        _laser(lambda m: replace(m, angle_min=np.degrees(m.angle_min), angle_increment=np.degrees(m.angle_increment))),
        "degrees",
    ),
    "fan of another sensor": (
        _laser(lambda m: replace(m, angle_min=-np.pi / 2, angle_increment=np.pi / (m.beams - 1))),
        "another sensor",
    ),
    "ranges in mm": (_ranges(lambda r, _: 1000 * r), "millimetres"),
    "ranges in cm": (_ranges(lambda r, _: 100 * r), "centimetres"),
    "all 0": (_ranges(lambda r, _: 0 * np.nan_to_num(r, posinf=0)), "almost no readings"),
    "constant": (_ranges(lambda r, _: 0 * np.nan_to_num(r, posinf=0) + 1.234), "all ranges are"),
    "stuck": (_ranges(lambda r, _: np.tile(r[20], (len(r), 1))), "equal the one before"),
    "no return as 4.095": (_ranges(lambda r, _: np.where(np.isinf(r), 4.095, r)), "exactly"),
    "in another order": (_ranges(lambda r, rng: rng.permutation(r)), "another order"),
    "backwards in time": (_ranges(lambda r, _: r[::-1]), "order"),
    "clock of the scans": (_late, "clocks of scans"),
}
