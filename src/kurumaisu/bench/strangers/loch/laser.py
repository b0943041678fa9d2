# SPDX-License-Identifier: BSD-3-Clause
"""Rooms with furniture, and the URG-04LX in them: geometry, equation (4), and what effects do to either."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kurumaisu.bench.strangers.loch.motion import MODEL, Array, Drive, Effect, Hidden, Path
from kurumaisu.bench.strangers.tilt import tilted

COLOURS = {"gray80": 0.9, "gray50": 0.5, "gray10": 0.15}
CHAIR = ((-0.02, 0.36), (0.2, 0.36), (0.42, 0.36))


class Box(NamedTuple):
    """A thing that stands in the room: middle, size, turn, colour."""

    x: float
    y: float
    a: float
    b: float
    turn: float
    colour: str


def _corners(box: Box) -> Array:
    """Its four corners in order."""
    c, s = np.cos(box.turn), np.sin(box.turn)
    u = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array([box.a, box.b]) / 2
    return np.asarray(u @ np.array([[c, s], [-s, c]]) + np.array([box.x, box.y]))


class Walls(NamedTuple):
    """Segments from p by d, and how much light each sends back."""

    p: Array
    d: Array
    shine: Array


def room(rng: np.random.Generator) -> list[Box]:
    """Four walls, of which one is dark, and furniture along them and in the corners."""
    size = (rng.uniform(6.0, 9.0), rng.uniform(5.5, 8.0))
    tones = rng.permutation(["gray80", "gray80", "gray50", "gray10"])
    boxes = [
        Box(0, sy * (size[1] / 2 + 0.05), size[0] + 0.2, 0.1, 0, str(c))
        for sy, c in zip((-1, 1), tones[:2], strict=True)
    ]
    boxes += [
        Box(sx * (size[0] / 2 + 0.05), 0, 0.1, size[1] + 0.2, 0, str(c))
        for sx, c in zip((-1, 1), tones[2:], strict=True)
    ]
    for _ in range(int(rng.integers(5, 9))):
        long, deep, axis = rng.uniform(0.4, 1.5), rng.uniform(0.3, 0.6), int(rng.integers(2))
        turn = float(rng.normal(0, 0.15)) if rng.random() < 0.4 else 0.0
        off = float(rng.choice([-1, 1])) * (size[1 - axis] / 2 - deep / 2 - rng.uniform(0.0, 0.15))
        along = rng.uniform(-0.5, 0.5) * (size[axis] - long)
        place = (off, along, deep, long) if axis else (along, off, long, deep)
        boxes.append(Box(*place, turn, str(rng.choice(list(COLOURS)))))
    return boxes


def walls(boxes: list[Box], shift: Array | None = None) -> Walls:
    """All sides of all boxes; a shift moves each box."""
    ps = [_corners(box) + (0 if shift is None else shift[i]) for i, box in enumerate(boxes)]
    ds = [np.roll(c, -1, axis=0) - c for c in ps]
    return Walls(np.concatenate(ps), np.concatenate(ds), np.repeat([COLOURS[b.colour] for b in boxes], 4))


def cast(w: Walls, x: Array, y: Array, angle: Array) -> tuple[Array, NDArray[np.int64]]:
    """Range of the nearest wall along each beam, and which it is."""
    ux, uy = np.cos(angle), np.sin(angle)
    best, which = np.full(x.shape, np.inf), np.zeros(x.shape, dtype=np.int64)
    for i, ((px, py), (dx, dy)) in enumerate(zip(w.p.tolist(), w.d.tolist(), strict=True)):
        det = dx * uy - dy * ux
        det = np.where(np.abs(det) < 1e-12, 1e-12, det)
        r, u = (dx * (py - y) - dy * (px - x)) / det, (ux * (py - y) - uy * (px - x)) / det
        closer = (u >= 0) & (u <= 1) & (r > 1e-6) & (r < best)
        best, which = np.where(closer, r, best), np.where(closer, i, which)
    return best, which


def clearance(w: Walls, poses: Array) -> float:
    """How near the chair's outline comes to the walls."""
    nearest = np.inf
    for ahead, radius in CHAIR:
        q = poses[:, :2] + ahead * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
        rel = q[:, None, :] - w.p[None]
        u = np.clip((rel * w.d).sum(-1) / (w.d**2).sum(-1), 0, 1)
        nearest = min(nearest, float(np.linalg.norm(rel - u[..., None] * w.d, axis=-1).min()) - radius)
    return nearest


def text(boxes: list[Box]) -> str:
    """The room as a Stage world."""
    head = '# A room, measured with a tape. Metres, degrees.\nname "room"\ndefine thing model\n(\n  gui_move 0\n)\n'
    return head + "".join(
        [
            f'thing ( name "thing_{i}" pose [{b.x:.6f} {b.y:.6f} 0 {np.degrees(b.turn):.6f}] '
            f'size [{b.a:.6f} {b.b:.6f} 2.0] color "{b.colour}" ranger_return {COLOURS[b.colour]} )\n'
            for i, b in enumerate(boxes)
        ]
    )


MOUNT: dict[str, float] = MODEL["laser"]["mount"]
ERROR: dict[str, float] = {k: v for k, v in MODEL["laser"]["error"].items() if k != "sigma"}
SIGMA: list[float] = MODEL["laser"]["error"]["sigma"]
LASER: dict[str, Effect] = {}
Mask = NDArray[np.bool_]
Shot = SimpleNamespace


@dataclass(frozen=True)
class Fan:
    """The beams of a scan."""

    first: float
    step: float
    beams: int
    dt: float

    @property
    def angles(self) -> Array:
        """Bearing of each beam."""
        return self.first + self.step * np.arange(self.beams)


def rng_of(s: Shot, h: Hidden, own: bool = True) -> np.random.Generator:
    """Randomness of an effect: of its own for each drive, or one for all."""
    return np.random.default_rng([int(1e6 * a) for a in h.u] + ([s.drive.seed] if own else []))


def _cast(s: Shot, poses: Array | None) -> None:
    """Sends the beams out, each from where the chair is in that moment, or scans from given poses; their slopes."""
    p, about = s.path.at(s.t[:, None] + s.late[:, None] + s.sweep[None]), s.path.at(s.t) if poses is None else poses
    if poses is not None:
        p = _carried(s.path.at(s.t), poses, p)
    c, n, (bearing, down) = np.cos(p[..., 2]), np.sin(p[..., 2]), tilted(s.fan.angles, s.pitch, s.roll)
    x, y, s.direction = p[..., 0] + c * s.x - n * s.y, p[..., 1] + n * s.x + c * s.y, p[..., 2] + s.yaw + bearing
    r, which = cast(s.walls, x, y, s.direction)
    ux, uy, dx, dy = np.cos(s.direction), np.sin(s.direction), s.walls.d[which, 0], s.walls.d[which, 1]
    det = dx * uy - dy * ux
    s.cos, s.shine = np.abs(det) / np.hypot(dx, dy), s.walls.shine[which]
    turn = -(r * (dx * ux + dy * uy) + dy * (y - about[:, 1:2]) + dx * (x - about[:, :1])) / det
    s.by_pose = np.stack([dy / det, -dx / det, turn], axis=-1)
    floor = np.where(down > 1e-6, MOUNT["z"] / np.sin(np.maximum(down, 1e-6)), np.inf)
    s.hit, s.r = np.where(r > floor, -1, which), np.minimum(r / np.cos(down), floor)
    s.hx, s.hy = x + s.r * ux, y + s.r * uy
    s.mean = ERROR["scale"] * s.r + ERROR["datum_offset"]
    s.sd = np.hypot(SIGMA[0] + SIGMA[1] * s.r + SIGMA[2] * s.r**2, ERROR["resolution"] / 12**0.5)
    s.common, s.event = np.zeros((len(s.t), 1)), np.zeros(r.shape, dtype=bool)


def _carried(have: Array, want: Array, p: Array) -> Array:
    """Poses of beams (scan, beam, 3), moved as their scans are moved from one pose to another."""
    turn = (want[:, 2] - have[:, 2])[:, None]
    dx, dy = p[..., 0] - have[:, None, 0], p[..., 1] - have[:, None, 1]
    c, n = np.cos(turn), np.sin(turn)
    return np.stack([want[:, None, 0] + c * dx - n * dy, want[:, None, 1] + n * dx + c * dy, p[..., 2] + turn], -1)


def shoot(
    drive: Drive, fan: Fan, boxes: list[Box], path: Path, t: Array, hidden: Sequence[Hidden], poses: Array | None = None
) -> Shot:
    """Scans without noise: means, scatter, events."""
    s = Shot(
        drive=drive,
        fan=fan,
        boxes=boxes,
        path=path,
        t=t,
        walls=walls(boxes),
        late=np.zeros(len(t)),
        sweep=fan.dt * np.arange(fan.beams),
        x=MOUNT["x"],
        y=MOUNT["y"],
        yaw=0.0,
        pitch=0.0,
        roll=0.0,
        common_sd=0.0,
        rho=0.0,
        post=[],
    )
    for stage in ("geometry", "reading"):
        for h in hidden:
            if h.id in LASER and LASER[h.id].stage == stage:
                LASER[h.id].act(s, h)
        if stage == "geometry":
            _cast(s, poses)
    return s


def readings(s: Shot, rng: np.random.Generator, dead: Mask) -> Array:
    """Readings with noise, rounding, gate and dead beams."""
    e = rng.normal(size=s.mean.shape)
    for j in range(1, e.shape[1] if s.rho else 0):
        e[:, j] = s.rho * e[:, j - 1] + (1 - s.rho**2) ** 0.5 * e[:, j]
    r = s.mean + s.common + e * s.sd
    for change in s.post:
        r = change(r)
    r = np.round(np.round(r / ERROR["resolution"]) * ERROR["resolution"], 6)
    r = np.where(r > ERROR["range_max"], np.inf, np.where(r < ERROR["range_min"], np.nan, r))
    r[:, dead] = np.nan
    return r


def beside_pose(mean: Array, by_pose: Array) -> Array:
    """Differences of readings per sd, whitened by what errors of the scans' poses do to them (scan, beam, 3), too."""
    size, turn = np.linalg.eigh(np.swapaxes(by_pose, 1, 2) @ by_pose)
    axes, shrink = by_pose @ turn, (1 / np.sqrt(1 + size) - 1) / np.maximum(size, 1e-9)
    return np.asarray(mean + (axes @ (shrink[..., None] * (np.swapaxes(axes, 1, 2) @ mean[..., None])))[..., 0])


def contrast(s: Shot, base: Shot, pose_sd: Array) -> Array:
    """What an effect does to readings, whitened: to their means, to their scatter, as events, to neighbours."""
    valid = base.mean < ERROR["range_max"]
    log = np.clip(2 * np.log(s.sd / base.sd), -4, 4)
    spread = np.sign(log) * np.sqrt(np.maximum(np.exp(log) - 1 - log, 0))
    step = np.abs(np.diff(base.mean, axis=1, prepend=base.mean[:, :1])) > 0.1
    smooth = valid & ~step & ~np.roll(step, -1, axis=1)
    weight = np.where(smooth & (s.hit == base.hit), 1 / base.sd, 0.0)
    mean = beside_pose(
        (s.mean + s.common - base.mean) * weight, (s.by_pose + base.by_pose) / 2 * pose_sd * weight[..., None]
    )
    parts = [np.where(w, a, 0.0).ravel() for w, a in ((valid, mean), (smooth, spread), (valid, s.event * 18**0.5))]
    return np.concatenate([*parts, [np.sqrt(-np.log(1 - s.rho**2) * valid.sum())]])
