# SPDX-License-Identifier: BSD-3-Clause
"""Robots, lasers, references and rooms; the casting of rays; the texts of model.yaml and of the map."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kurumaisu.params import shipped

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Rng = np.random.Generator
Segments = tuple[Array, Array, Ints]
Wall = tuple[str, float, float, float, float, float, str]  # name, x, y, degrees, sizes, colour


@dataclass
class Laser:
    """A fan with its noise: sigma are the coefficients of r^0, r^1, r^2."""

    name: str
    angle_min: float
    inc: float
    n: int
    scan_time: float
    tinc: float
    sigma: tuple[float, float, float]
    res: float
    rmin: float
    rmax: float
    scale: float = 1.0
    mount: tuple[float, float, float] = (0.2, 0.0, 0.0)
    height: float = 0.4

    @property
    def bearings(self) -> Array:
        """Return the beams' bearings in the laser's frame."""
        return np.asarray(self.angle_min + np.arange(self.n) * self.inc)

    def sd(self, r: Array) -> Array:
        """Return the noise of readings of ranges r."""
        return np.asarray(self.sigma[0] + self.sigma[1] * r + self.sigma[2] * r * r)


@dataclass
class Robot:
    """A differential robot; volts: driven by the wheelchair's voltages."""

    name: str
    vmax: float
    wmax: float
    sd_v: float
    sd_w: float
    tau: float
    meta: str
    volts: bool = False
    law: str = "corrected"


@dataclass
class Reference:
    """What measures the pose: rate, white errors, slow wander with its time."""

    name: str
    rate: float
    sp: float
    sh: float
    wp: float
    wh: float
    wtau: float


@dataclass
class Room:
    """Boxes of a Stage world and where one may drive."""

    walls: list[Wall]
    free: tuple[float, float, float, float]
    boxes: list[tuple[float, float, float]] = field(default_factory=list)


@dataclass
class Scene:
    """Robot, laser, room and reference of a case, how many drives there are, and what is recorded beside."""

    robot: Robot
    laser: Laser | None
    room: Room
    ref: Reference
    number: int
    unix: float
    hz: float
    columns: list[str]


D = np.pi / 180
URG = (0.002334, -0.000488, 0.000199)
LASERS = (  # the usual scanners, some beams of which were thinned
    Laser("URG-04LX", -2.086214, 0.006135923 * 3, 227, 0.1, 9.765625e-5 * 3, URG, 0.001, 0.06, 4.0, 1.004587),
    Laser("UTM-30LX", -135 * D, 1.5 * D, 181, 0.025, 0.025 / 240, (0.010, 0.0, 0.0002), 0.001, 0.1, 30.0),
    Laser("RPLIDAR-A1", -np.pi, 2 * D, 180, 0.18, 0.001, (0.004, 0.003, 0.0005), 0.001, 0.15, 12.0),
    Laser("LMS-200", -np.pi / 2, D, 181, 0.0267, 0.0133 / 180, (0.005, 0.0005, 0.0), 0.001, 0.1, 8.0),
    Laser("LDS-01", -np.pi, 2 * D, 180, 0.2, 0.2 / 180, (0.005, 0.003, 0.001), 0.001, 0.12, 3.5),
)
ROBOTS = (
    ("burger", 0.22, 1.4, 0.004, 0.02, "{kind: diff_drive, radius: 0.033, track: 0.16}"),
    ("kobuki", 0.5, 1.4, 0.007, 0.02, "{kind: diff_drive, radius: 0.035, track: 0.23}"),
    ("cart", 1.2, 0.9, 0.015, 0.015, "velocity"),
    ("pioneer", 0.7, 1.2, 0.01, 0.02, "velocity"),
    ("waffle", 0.26, 1.5, 0.005, 0.02, "velocity"),
)


def draw_laser(rng: Rng) -> Laser:
    """Draw one of the scanners, and its place."""
    laser = LASERS[int(rng.integers(5))]
    x, y = round(float(rng.uniform(-0.05, 0.3)), 3), round(float(rng.uniform(-0.05, 0.05)), 3)
    return replace(laser, mount=(x, y, 0.0))


def draw_robot(rng: Rng, volts: bool | None, law: str) -> Robot:
    """Draw a robot; volts: None for any."""
    k = int(rng.integers(8))
    if volts or (volts is None and k < 2):
        return Robot("MD-100", 0.8, 1.0, 0.012, 0.02, float(rng.uniform(0.2, 0.5)), "md100", True, law)
    if k < 3:
        return Robot("MD-100 by rates", 0.8, 1.0, 0.012, 0.02, float(rng.uniform(0.2, 0.5)), "md100")
    name, v, w, a, b, meta = ROBOTS[int(rng.integers(len(ROBOTS)))]
    f = float(rng.uniform(0.8, 1.3))
    return Robot(name, v, w, a * f, b * f, float(rng.uniform(0.15, 0.6)), meta)


def draw_reference(rng: Rng) -> Reference:
    """Draw motion capture, a total station with a prism on either side, or matched scans."""
    k, u = int(rng.integers(3)), float(rng.uniform(0.8, 1.3))
    if k == 0:
        return Reference("mocap", float(rng.choice([20, 30, 50])), 0.001 * u, 0.002 * u, 0.001, 0.001, 40.0)
    if k == 1:
        return Reference("total station", float(rng.choice([5, 8, 10])), 0.003 * u, 0.005 * u, 0.002, 0.002, 60.0)
    return Reference("scan matching", float(rng.choice([2, 5, 10, 20])), 0.008 * u, 0.005 * u, 0.006, 0.003, 30.0)


def draw_room(rng: Rng, small: bool) -> Room:
    """Draw a room with things along its walls; small: for a laser that does not see far."""
    corridor = rng.random() < 0.25
    lx = float(np.round(rng.uniform(9, 13) if corridor else rng.uniform(5.5, 7 if small else 10), 2))
    ly = float(np.round(rng.uniform(3.2, 4.0) if corridor else rng.uniform(4.8, 6 if small else 8), 2))
    th, colours = 0.1, ["gray30", "tan", "black", "white"]
    walls: list[Wall] = [
        ("south", lx / 2, -th / 2, 0.0, lx + 2 * th, th, "gray30"),
        ("north", lx / 2, ly + th / 2, 0.0, lx + 2 * th, th, str(rng.choice(colours))),
        ("west", -th / 2, ly / 2, 0.0, th, ly, "gray30"),
        ("east", lx + th / 2, ly / 2, 0.0, th, ly, "tan"),
    ]
    walls = [(n, round(x, 4), round(y, 4), a, round(sx, 4), round(sy, 4), q) for n, x, y, a, sx, sy, q in walls]
    room = Room(walls, (0.75, lx - 0.75, 0.75, ly - 0.75))
    for i in range(int(rng.integers(4, 8))):
        sx, sy = (round(float(rng.uniform(0.3, 0.7)), 2) for _ in range(2))
        side, u = int(rng.integers(4)), float(rng.uniform(0.08, 0.92))
        x, y = [(u * lx, 0.25), (u * lx, ly - 0.25), (0.25, u * ly), (lx - 0.25, u * ly)][side]
        a = round(float(rng.choice([0.0, 0.0, rng.uniform(-45, 45)])), 1)
        room.walls.append((f"box{i}", round(x, 3), round(y, 3), a, sx, sy, str(rng.choice(colours))))
        room.boxes.append((x, y, float(np.hypot(sx, sy)) / 2 + 0.35))
    return room


def inside(room: Room, x: Array, y: Array) -> bool:
    """Tell whether all of a path can be driven."""
    a, b, c, d = room.free
    ok = x.min() > a and x.max() < b and y.min() > c and y.max() < d
    return bool(ok and all((np.hypot(x - p, y - q) > r).all() for p, q, r in room.boxes))


def segments(room: Room, scale: float = 0.0, moved: Array | None = None) -> Segments:
    """Return both ends (S, 2) of the walls' sides and the wall of each; scale, moved: by what the map is wrong."""
    p, q, k = [], [], []
    for i, (_, x, y, deg, sx, sy, _c) in enumerate(room.walls):
        a = np.radians(deg)
        rot = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        c = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * np.array([sx, sy]) @ rot.T + [x, y]
        if moved is not None:
            c = c + moved[i]
        p.append(c)
        q.append(np.roll(c, -1, axis=0))
        k.append(np.full(4, i))
    return np.concatenate(p) * (1 + scale), np.concatenate(q) * (1 + scale), np.concatenate(k)


def cast(x: Array, y: Array, phi: Array, segs: Segments) -> tuple[Array, Ints, Array]:
    """Return range, wall and cosine of incidence of each ray, in the shape of x."""
    shape = x.shape
    x, y, phi = x.ravel(), y.ravel(), phi.ravel()
    p, q, wall = segs
    e = q - p
    ranges, hit, cosi = np.empty(x.size), np.empty(x.size, np.int64), np.empty(x.size)
    length = np.hypot(e[:, 0], e[:, 1])
    for i in range(0, x.size, 4096):
        s = slice(i, i + 4096)
        dx, dy = np.cos(phi[s])[:, None], np.sin(phi[s])[:, None]
        ax, ay = p[:, 0] - x[s][:, None], p[:, 1] - y[s][:, None]
        det = dx * e[:, 1] - dy * e[:, 0]
        det = np.where(abs(det) < 1e-12, 1e-12, det)
        r = (ax * e[:, 1] - ay * e[:, 0]) / det
        u = (ax * dy - ay * dx) / det
        r[(u < 0) | (u > 1) | (r < 1e-4)] = np.inf
        k = r.argmin(1)
        j = np.arange(k.size)
        ranges[s], hit[s], cosi[s] = r[j, k], wall[k], abs(det[j, k]) / length[k]
    return ranges.reshape(shape), hit.reshape(shape), np.clip(cosi, 0.02, 1).reshape(shape)


def world_text(room: Room) -> str:
    """Return the map as a Stage world."""
    out = ['name "room"', "define wall model", "(", '  color "gray30"', "  gui_move 0", ")", ""]
    for name, x, y, a, sx, sy, colour in room.walls:
        out.append(f'wall ( name "{name}" pose [{x} {y} 0 {a}] size [{sx} {sy} 1.0] color "{colour}" )')
    return "\n".join(out)


def model_text(robot: Robot, laser: Laser | None) -> str:
    """Return model.yaml: the wheelchair's with this robot's law and laser."""
    text = shipped("launch/md100.yaml").read_text(encoding="utf-8")
    new: dict[str, Any] = {"name": robot.name, "voltage_law": robot.law}
    if laser:
        x, y, yaw = laser.mount
        new["  mount"] = f"{{x: {x}, y: {y}, z: {laser.height}, yaw: {yaw}}}"
        new |= {"  angle_min": repr(laser.angle_min), "  angle_increment": repr(laser.inc), "  beams": laser.n}
        new |= {"  scan_time": laser.scan_time, "  time_increment": f"{laser.tinc:.9f}", "    scale": laser.scale}
        new |= {"    datum_offset": 0.0, "    sigma": list(laser.sigma), "    resolution": laser.res}
        new |= {"    range_min": laser.rmin, "    range_max": laser.rmax}
    for key, value in new.items():
        text, n = re.subn(rf"(?m)^{key}:.*$", f"{key}: {value}", text, count=1)
        assert n == 1, key
    return text.rstrip("\n")
