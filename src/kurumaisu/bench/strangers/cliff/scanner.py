# SPDX-License-Identifier: BSD-3-Clause
"""The laser: which rays it casts, what is hidden in its readings, and what that weighs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from .room import Room, cast, other_map
from .values import Array, Cause, Noise, Rng

MOUNT = np.array([0.30, 0.0, 0.0])
HEIGHT = 0.40
FIRST, INCREMENT, BEAMS = -2.086214, 0.006135923, 682
TICK = 9.765625e-5  # [s] between neighbouring beams of the full fan
SCALE, DATUM = 1.004587, 0.058826


def sigma(r: Array) -> Array:
    """Equation (4)'s sd."""
    return 0.000199 * r * r - 0.000488 * r + 0.002334


@dataclass
class Scans:
    """The scans of one run and what each ray met."""

    stamp: Array  # [s] from the start of the run
    session: float  # [s] start of the run on the session's clock
    beams: Array  # indices in the full fan
    poses: Callable[[Array], Array]  # true poses at times (from the start of the run)
    extra: dict[str, Array] = field(default_factory=dict)  # per scan: v, w, temperature, columns
    r: Array = field(default_factory=lambda: np.zeros(0))
    side: Array = field(default_factory=lambda: np.zeros(0))
    pose: Array = field(default_factory=lambda: np.zeros(0))  # of base_link, at the time of each beam
    angle: Array = field(default_factory=lambda: np.zeros(0))  # of each ray, in the map
    slant: Array = field(default_factory=lambda: np.zeros(0))  # |cos| of the incidence

    @property
    def bearing(self) -> Array:
        """Bearing of each beam in the laser's frame."""
        return np.asarray(FIRST + INCREMENT * self.beams)

    def trace(self, room: Room, causes: Sequence[Cause]) -> None:
        """Cast all rays, with what is hidden in the geometry and the clock."""
        size = {c.id: (0.0 if c.other else c.size) for c in causes}
        more = {c.id: c for c in causes if c.other}
        tick = TICK * (1.0 + size.get("laser.sweep", 0.0))
        late = size.get("laser.latency", 0.0)
        base = self.stamp - late - size.get("laser.clock_skew", 0.0) * (self.session + self.stamp)
        if "laser.latency" in more:  # other: the delay wanders
            base = base - more["laser.latency"].size * (1.0 + np.sin(self.stamp / 5.0))
        t = base[:, None] + tick * (self.beams - self.beams[0])
        self.pose = self.poses(t.ravel()).reshape(*t.shape, 3)
        mx, my, mt = MOUNT + [size.get(f"laser.mount_{k}", 0.0) for k in ("x", "y", "yaw")]
        if "laser.mount_yaw" in more:  # other: it works loose in turns to one side
            mt = mt + more["laser.mount_yaw"].size * (self.extra["w"] > 0)[:, None]
        x, y, th = np.moveaxis(self.pose, 2, 0)
        self.angle = th + mt + self.bearing
        lx, ly = x + np.cos(th) * mx - np.sin(th) * my, y + np.sin(th) * mx + np.cos(th) * my
        for c in causes:
            if c.id == "world.map_error":
                shift = c.size * np.random.default_rng(int(c.more["draw"])).standard_normal(len(room.boxes))
                room = other_map(room, 0.0 if not c.more["scaled"] else c.size, shift * (not c.more["scaled"]))
        self.r, self.side = cast(room, lx, ly, self.angle)
        p, q, _ = room.segments()
        way = np.arctan2(*(q - p).T[::-1])[self.side]
        self.slant = np.maximum(np.abs(np.sin(way - self.angle)), 0.02)

    def slopes(self) -> Array:
        """How each range changes with x, y (map) and heading of the base (scans, beams, 3)."""
        return _slopes(self)


def _slopes(s: Scans) -> Array:
    signed = s.extra["normal"] - s.angle  # angle from the ray to the wall's normal
    c = np.cos(signed)
    nx, ny = np.cos(s.extra["normal"]), np.sin(s.extra["normal"])
    hx = MOUNT[0] * np.cos(s.pose[..., 2]) + s.r * np.cos(s.angle)
    hy = MOUNT[0] * np.sin(s.pose[..., 2]) + s.r * np.sin(s.angle)
    return np.stack([-nx / c, -ny / c, (nx * hy - ny * hx) / c], axis=2)


def with_normals(s: Scans, room: Room) -> Scans:
    """Keep the direction of the normal that each ray met."""
    p, q, _ = room.segments()
    s.extra["normal"] = (np.arctan2(*(q - p).T[::-1]) + np.pi / 2)[s.side]
    return s


def _body(s: Scans, dx: Array | float, dy: Array | float) -> Array:
    """What a shift of the laser in the body frame makes of the ranges."""
    h, th = s.slopes(), s.pose[..., 2]
    out: Array = h[..., 0] * (np.cos(th) * dx - np.sin(th) * dy) + h[..., 1] * (np.sin(th) * dx + np.cos(th) * dy)
    return out


def _yaw(s: Scans) -> Array:
    """What a turn of the laser makes of them: a turn of the base, less the shift of the laser."""
    return s.slopes()[..., 2] - _body(s, 0.0, MOUNT[0])


def _moved(s: Scans, dt: Array) -> Array:
    """What a scan taken dt earlier makes of them."""
    v, w = s.extra["v"][:, None], s.extra["w"][:, None]
    return np.asarray(-dt * (_body(s, v, 0.0) + s.slopes()[..., 2] * w))


def _tilt(s: Scans, a: float, c: Cause) -> Array:
    down = a * np.cos(s.bearing - c.more.get("toward", 0.0))
    r = s.r / np.cos(down)
    with np.errstate(divide="ignore"):
        floor = np.where(down > 0.01, HEIGHT / np.sin(np.maximum(down, 1e-6)), np.inf)
    return np.asarray(np.minimum(r, floor) - s.r)


def _fan(s: Scans, a: float, c: Cause) -> Array:
    rng = np.random.default_rng(int(c.more.get("draw", 1)))
    e = rng.standard_normal(BEAMS)
    if c.other:  # neighbours alike: a bent mirror
        e = np.sin(2 * np.pi * np.arange(BEAMS) / 150.0 + e[0]) * 1.4
    return np.asarray(a * e[s.beams] + 0 * s.r)


def _session(s: Scans) -> Array:
    return np.asarray((s.session + s.stamp)[:, None] + 0 * s.r)


Mean = Callable[[Scans, float, Cause], Array]
# what each adds to the true range; those of the geometry to first order (the hidden one is cast exactly)
MEANS: dict[str, tuple[Mean, float]] = {
    "laser.mount_x": (lambda s, a, c: a * _body(s, 1.0, 0.0), 0.01),
    "laser.mount_y": (lambda s, a, c: a * _body(s, 0.0, 1.0), 0.01),
    "laser.mount_yaw": (lambda s, a, c: a * _yaw(s), 0.005),
    "laser.sweep": (lambda s, a, c: _moved(s, -a * TICK * (s.beams - s.beams[0])[None, :]), 0.1),
    "laser.latency": (lambda s, a, c: _moved(s, np.full((1, 1), a)), 0.01),
    "laser.clock_skew": (lambda s, a, c: _moved(s, a * _session(s)), 1e-4),
    "laser.tilt": (_tilt, 0.03),
    "laser.offset": (lambda s, a, c: a * (1.0 if not c.other else np.sign(np.sin(_session(s) / 4.0))) + 0 * s.r, 0.003),
    "laser.scale": (lambda s, a, c: a * (s.r if not c.other else 3.0 * (s.r - 2.5) * (s.r > 2.5)), 0.002),
    "laser.quadratic": (lambda s, a, c: a * (s.r**2 if not c.other else s.r**4 / 8.0), 0.0006),
    "laser.warmup": (lambda s, a, c: a * np.exp(-_session(s) / c.more.get("tau", 600.0)), 0.003),
    "laser.temperature": (lambda s, a, c: a * (s.extra["temperature"][:, None] - 20.0) + 0 * s.r, 0.0003),
    "laser.cyclic": (lambda s, a, c: a * _wave(s, c), 0.002),
    "laser.incidence_bias": (
        lambda s, a, c: a * (1.0 / s.slant - 1.0 if not c.other else 4.0 * (s.slant < 0.35)),
        0.001,
    ),
    "laser.reflectance": (lambda s, a, c: a * (s.extra["dull"] if not c.other else s.extra["dull"] * s.r / 2.0), 0.005),
    "laser.beam_bias": (_fan, 0.001),
}


def _wave(s: Scans, c: Cause) -> Array:
    wave = np.sin(2 * np.pi * s.r / c.more.get("wavelength", 3.0) + c.more.get("phase", 0.0))
    return np.asarray(np.sign(wave) if c.other else wave)


SCATTER = {"laser.range_noise": 0.05, "laser.incidence_noise": 0.1, "laser.beam_correlation": 0.08}
CAST = {
    "laser.mount_x",
    "laser.mount_y",
    "laser.mount_yaw",
    "laser.sweep",
    "laser.latency",
    "laser.clock_skew",
    "world.map_error",
}


def bias(s: Scans, causes: Sequence[Cause], extra: dict[str, Mean] | None = None) -> Array:
    """What is hidden in the mean, but for the geometry, which is cast."""
    out = 0.0 * s.r
    for c in causes:
        if c.id in MEANS and c.id not in CAST:
            out = out + MEANS[c.id][0](s, c.size, c)
        elif extra and c.id in extra:
            out = out + extra[c.id](s, c.size, c)
    return out


def spread(s: Scans, causes: Sequence[Cause], extra: dict[str, Mean] | None = None) -> Array:
    """Factor of the sd."""
    out = np.ones_like(s.r)
    for c in causes:
        if c.id == "laser.range_noise":
            out = out * (1.0 + c.size * (1.0 if not c.other else 2.0 * (s.r > 2.0)))
        elif c.id == "laser.incidence_noise":
            out = out * (1.0 + c.size * (1.0 / s.slant - 1.0 if not c.other else 3.0 * (s.slant < 0.4)))
        elif extra and c.id in extra:
            out = out * (1.0 + extra[c.id](s, c.size, c))
    return out


def readings(s: Scans, causes: Sequence[Cause], rng: Rng, extra: tuple[dict[str, Mean], dict[str, Mean]]) -> Array:
    """Bias, noise, steps of 1 mm, and gate, in this order."""
    e = rng.standard_normal(s.r.shape)
    for c in causes:
        if c.id == "laser.beam_correlation":
            e = lfilter([np.sqrt(1.0 - c.size**2)], [1.0, -c.size], e, axis=1)
    with np.errstate(invalid="ignore"):
        true = s.r + bias(s, causes, extra[0])
        r = SCALE * true + DATUM + sigma(np.minimum(true, 5.0)) * spread(s, causes, extra[1]) * e
    r = np.round(np.where(np.isfinite(r), r, np.inf), 3)
    return np.where(r > 4.0, np.inf, np.where(r < 0.06, np.nan, r))


def steady(s: Scans) -> Array:
    """Readings inside the gate and away from edges: neighbours meet the same side."""
    same = np.ones(s.side.shape, bool)
    for far in (1, 2):
        same[:, far:] &= s.side[:, far:] == s.side[:, :-far]
        same[:, :-far] &= s.side[:, far:] == s.side[:, :-far]
    with np.errstate(invalid="ignore"):
        return same & (s.r < 3.85) & (s.r > 0.1) & (s.slant > 0.15)


def information(s: Scans, signals: Array, noise: Noise, pose_var: Array, ok: Array) -> Array:
    """S' C^-1 S for the signals (scans, beams, m) of one run.

    C is sigma^2 + step^2/12 of each reading, the white error of each scan's pose (what rows around it leave: half of
    the filtered variance), and the reference's drift, which is taken as one shift per block of 10 s.
    """
    m = signals.shape[2]
    blocks = [(np.zeros((m, m)), np.zeros((3, m)), np.zeros((3, 3))) for _ in range(int(s.stamp[-1] / 10.0) + 1)]
    weight = 1.0 / (sigma(np.minimum(s.r, 5.0)) ** 2 + 1e-6 / 12)
    h = s.slopes()
    for k, t in enumerate(s.stamp):
        o = ok[k]
        a, b, w = h[k][o], signals[k][o], weight[k][o][:, None]
        aa, ab, bb = a.T @ (w * a), a.T @ (w * b), b.T @ (w * b)
        inner = np.linalg.inv(np.diag(1.0 / pose_var) + aa)
        block = blocks[int(t / 10.0)]
        block[0][...] += bb - ab.T @ inner @ ab
        block[1][...] += ab - aa @ inner @ ab
        block[2][...] += aa - aa @ inner @ aa
    total = np.zeros((m, m))
    for bb, ab, aa in blocks:
        total += bb - ab.T @ np.linalg.inv(np.diag(1.0 / noise.drift**2) + aa) @ ab
    return total
