# SPDX-License-Identifier: BSD-3-Clause
"""The laser: where its beams end, what they read on average, and how readings scatter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from kurumaisu.bench.strangers.holm.core import Array, Effect
from kurumaisu.bench.strangers.holm.rooms import Room

SCALE, DATUM, SIGMA = 1.004587, 0.058826, (0.002334, -0.000488, 0.000199)
STEP, NEAR, FAR, HEIGHT = 0.001, 0.06, 4.0, 0.40
Poses = Callable[[Array], Array]


@dataclass(frozen=True)
class Fan:
    """Where the laser is and what it sees."""

    x: float
    y: float
    yaw: float
    angle_min: float
    angle_increment: float
    beams: int
    time_increment: float


@dataclass
class Look:
    """Scans: every array is (scans, beams), or (scans, 1) of a whole scan."""

    stamp: Array
    session: Array
    parity: Array
    bearing: Array
    pose: Array
    direction: Array
    r: Array
    cos: Array
    shine: Array
    hit_x: Array
    mu: Array
    sd: Array
    extra: dict[str, Array]
    common: Array | None = None
    error: Array = field(default_factory=lambda: np.zeros(0))
    read: Array = field(default_factory=lambda: np.zeros(0))
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    @property
    def valid(self) -> Array:
        """Whether a reading is within the gate."""
        return np.asarray(np.isfinite(self.mu) & (self.mu > NEAR + 0.01) & (self.mu < FAR - 0.02))

    @property
    def incidence(self) -> Array:
        """Angle between beam and the wall's normal."""
        return np.asarray(np.arccos(np.clip(self.cos, 0, 1)), dtype=float)


def look(
    room: Room,
    poses: Poses,
    stamps: Array,
    fan: Fan,
    effects: Sequence[Effect],
    *,
    beams: Array | None = None,
    start: float = 0.0,
    index: Array | None = None,
    extra: dict[str, Array] | None = None,
) -> Look:
    """What the laser reads on average in scans stamped so; poses gives the chair's pose at true times."""
    beam = np.arange(fan.beams) if beams is None else beams
    mine = [e for e in effects if e.hook in ("mount", "stamps", "sweep", "tilt", "room")]

    def get(key: str) -> float:
        return sum(e.settings.get(key, 0.0) for e in mine)

    session = stamps + start
    began = stamps - get("delay") - get("skew") * session
    t = began[:, None] + beam * fan.time_increment * (1 + get("stretch"))
    pose = poses(t)
    bearing = fan.angle_min + beam * fan.angle_increment + np.zeros_like(t)
    mx, my = fan.x + get("mount_x"), fan.y + get("mount_y")
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    ox, oy = pose[..., 0] + c * mx - s * my, pose[..., 1] + s * mx + c * my
    direction = pose[..., 2] + fan.yaw + get("mount_yaw") + bearing
    for e in mine:
        if e.hook == "room":
            made = e.settings
            rng = np.random.default_rng(int(made.get("seed", 0)))
            room = room.scaled(1 + made.get("scale", 0.0), rng.normal(0, made.get("sd", 0.0), (len(room.boxes), 2)))
    origin = np.stack([ox.ravel(), oy.ravel()], axis=-1)
    r, cos, face = room.cast(origin, direction.ravel())
    r, cos, face = r.reshape(t.shape), cos.reshape(t.shape), face.reshape(t.shape)
    pitch, roll = get("pitch"), get("roll")
    if pitch or roll:
        down = np.arcsin(np.clip(np.cos(bearing) * np.sin(pitch) + np.sin(bearing) * np.sin(roll), -1, 1))
        with np.errstate(divide="ignore"):
            floor = np.where(down > 1e-6, HEIGHT / np.sin(np.maximum(down, 1e-9)), np.inf)
        r = np.minimum(r / np.cos(down), floor)
    shine = np.where(face >= 0, room.shine[face], 1.0)
    far, near = np.where(np.isfinite(r), r, 99.0), np.minimum(r, 8)
    parity = (np.arange(stamps.size) if index is None else index) % 2
    found = Look(
        stamps[:, None],
        session[:, None],
        parity[:, None],
        bearing,
        pose,
        direction,
        far,
        cos,
        shine,
        ox + far * np.cos(direction),
        SCALE * r + DATUM,
        SIGMA[0] + SIGMA[1] * near + SIGMA[2] * near * near,
        {k: np.interp(stamps, np.arange(v.size), v)[:, None] for k, v in (extra or {}).items()},
    )
    for hook in ("mean", "spread"):
        for e in effects:
            if e.hook == hook:
                e.act(found)
    return found


def read(seen: Look, effects: Sequence[Effect], rng: np.random.Generator) -> Array:
    """Readings: nan for no valid one, inf for no return."""

    def act(hook: str) -> None:
        for e in effects:
            if e.hook == hook:
                seen.rng = np.random.default_rng(int(rng.integers(1 << 30)))
                e.act(seen)

    seen.error = rng.standard_normal(seen.mu.shape)
    act("error")
    common = 0.0 if seen.common is None else seen.common
    seen.read = seen.mu + seen.sd * seen.error + common
    act("reading")
    with np.errstate(invalid="ignore"):
        out = np.round(seen.read / STEP) * STEP
        seen.read = np.where(out < NEAR, np.nan, np.where(out > FAR, np.inf, out))
    act("last")
    return np.asarray(seen.read)
