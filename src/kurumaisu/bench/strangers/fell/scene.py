# SPDX-License-Identifier: BSD-3-Clause
"""A robot in a room: its drives, its reference, its scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.fell.laser import Context, Laser, draw_laser, readings, sample
from kurumaisu.bench.strangers.fell.plant import DT, Array, Bools, Cause, Pose, Rng, Robot, Way, travel
from kurumaisu.bench.strangers.fell.room import Room, draw_room

EMPTY = np.zeros(0)


class Reference(NamedTuple):
    """What measures the poses: rate, white noise of places and headings, slow wander of both and its time."""

    name: str
    rate: float
    sd: float
    sd_h: float
    slow: float
    slow_h: float
    tau: float


REFERENCES = (
    Reference("motion capture", 25, 0.0012, 0.002, 0.0012, 0.0010, 30),
    Reference("scan matching", 10, 0.006, 0.004, 0.005, 0.003, 20),
    Reference("total station, two prisms", 8, 0.003, 0.005, 0.001, 0.001, 40),
)
ROBOTS = (  # name, rates, size, radius and track, sd of v, ramp
    ("small", 0.26, 1.4, 0.12, 0.033, 0.16, 0.004, 0.8),
    ("lab", 0.7, 1.2, 0.26, 0.0975, 0.38, 0.007, 1.2),
    ("carrier", 1.0, 0.9, 0.35, 0.1, 0.5, 0.009, 1.0),
)


class Drive(NamedTuple):
    """One drive: what was asked for, where it was; poses measured, which are off; scans."""

    rows: Array
    n: int
    start: tuple[float, float, float]
    ctx: dict[str, Array]
    way: Way
    tp: Array = EMPTY
    poses: Array = EMPTY
    off: Bools = EMPTY > 0
    ts: Array = EMPTY
    scans: Array = EMPTY


@dataclass
class Scene:
    """All of a case."""

    robot: Robot
    room: Room
    ref: Reference
    las: Laser | None
    causes: list[Cause]
    drives: list[Drive]


def draw_robot(rng: Rng, volts: bool, law: str) -> Robot:
    """Draw the wheelchair, or one of the usual differential robots."""
    sd, style = float(np.exp(rng.uniform(0, 0.5))), str(rng.choice(["person", "auto", "script"]))
    if volts or rng.random() < 0.35:
        kind = "chair" if rng.random() < 0.7 else "chair by v, w"
        return Robot(kind, True, 0.8, 0.9, law, 0.008 * sd, 0.012 * sd, 0.25, 10, 0.8, style, 0.42, "md100")
    name, v, w, size, rad, track, sv, ramp = ROBOTS[int(rng.integers(3))]
    meta = "velocity" if rng.random() < 0.5 else f"{{kind: diff_drive, radius: {rad}, track: {track}}}"
    rate = float(rng.choice([10, 15, 20]))
    return Robot(name, False, v, w, law, sv * sd, 0.014 * sd, 0.2, rate, ramp, style, size, meta)


def _wander(rng: Rng, n: int, dt: float, tau: float) -> Array:
    a, e = np.exp(-dt / tau), rng.standard_normal(n)
    e[1:] *= np.sqrt(1 - a * a)
    return np.asarray(lfilter([1], [1, -a], e))


def _segment(rng: Rng, rob: Robot, limit: str, fails: int) -> tuple[float, float, float]:
    """Return what the driver does next: speed, rate of turn, for how long; in a corner it turns."""
    if fails > 8 and limit != "speed":
        w = 0.5 * rob.wmax if limit == "left" else 0.8 * rob.wmax * (1 if fails % 2 else -1)
        return 0.0, w, rng.uniform(1, 4)
    if limit == "speed":
        w = float(rng.choice([0, 0.35, -0.35, 0.6, -0.6, 0.9, -0.9])) * rob.wmax
        return 0.5 * rob.vmax, w, rng.uniform(1.5, 4)
    kind = int(rng.choice(6, p=[0.12, 0.16, 0.2, 0.34, 0.10, 0.08]))

    def level() -> float:
        return float(rng.uniform(0.12, 1) if rob.style == "person" else rng.choice([0.15, 0.35, 0.6, 1.0]))

    v, w = level() * rob.vmax, level() * rob.wmax * float(rng.choice([-1, 1]))
    if rob.volts:
        w = float(np.sign(w)) * max(abs(w), 0.2)
    w, arc = (0.5 * rob.wmax, 1.0) if limit == "left" else (w, 0.7)
    v, w = ((0.0, 0.0), (0.0, w), (v, 0.0), (v, w * arc), (-v * 0.5, 0.0), (-v * 0.5, w * max(arc, 0.5)))[kind]
    return v, w, rng.uniform(1, 3) if kind == 0 else rng.uniform(1.5, 5)


def _context(rng: Rng, n: int) -> dict[str, Array]:
    """Return columns beside, and room for the poses that effects follow."""
    t, u, ph = (np.arange(n + 1) + 0.5) * DT, rng.uniform(50, 110), rng.uniform(0, 6)
    ctx = {k: np.zeros(n + 1) for k in ("th", "x", "y")}
    ctx["humidity"] = 45 + 9 * np.sin(2 * np.pi * t / u + ph) + 3 * np.sin(2 * np.pi * t / (u * 0.37) + 2 * ph)
    ctx["temperature"] = 22 + rng.uniform(3, 6) * np.sin(2 * np.pi * t / rng.uniform(120, 260) + ph)
    return ctx


def drive(rng: Rng, sc: Scene, duration: float, limit: str) -> Drive:
    """Drive about as one does who sees the walls: what would come too close is not done."""
    rob, room, n = sc.robot, sc.room, int(duration / DT)
    ctx = _context(rng, n)
    noise = np.stack([_wander(rng, n + 1, DT, rob.tau), _wander(rng, n + 1, DT, rob.tau)])
    margin, at = rob.size + 0.06, rng.uniform(0, 1, (400, 2)) * (room.width, room.height)
    at = at[room.clearance(at[:, 0], at[:, 1]) > margin + (0.25 if limit != "speed" else 0.8)]
    if not len(at):
        raise RuntimeError("no room to begin")
    start = (at[0, 0], at[0, 1], rng.uniform(-np.pi, np.pi))
    rows = [(0.05 + k / rob.rate, 0.0, 0.0) for k in range(int(2 * rob.rate))]
    now, last, fails, lean = 2.05, (0.0, 0.0), 0, 0.0
    follow = 4 if any(k.id.startswith("unknown.base") or k.id == "base.slope" for k in sc.causes) else 1
    slew = rob.ramp * (1e3 if rob.style == "script" or limit == "speed" else 1.0) / rob.rate
    while now < duration - 3:
        to_v, to_w, seconds = _segment(rng, rob, limit, fails)
        new, t1, (v, w) = list[tuple[float, float, float]](), now, last
        while t1 < now + seconds:
            hard = slew * (1 + 9 * (fails > 8))  # who comes too close brakes hard
            v, w = v + np.clip(to_v - v, -hard, hard), w + np.clip(to_w - w, -2.5 * hard, 2.5 * hard)
            lean = 0.9 * lean + 0.006 * rng.standard_normal() * (rob.style == "person" and not limit)
            new.append((round(t1, 4), round(v * (1 + lean), 4), round(w * (1 + 1.5 * lean), 4)))
            t1 += (1 + 0.08 * rng.uniform(-1, 1)) / rob.rate
        tried, end = np.array([*rows, *new, (t1, 0.0, 0.0)]), min(int((t1 + 0.3) / DT), n)
        trial = travel(rob, sc.causes, tried, end, start, ctx, noise, follow)
        left = room.clearance(trial.x[int(now / DT) :: 4], trial.y[int(now / DT) :: 4]).min()
        if left < margin - 0.06 * (fails > 30):
            fails += 1
            if fails > 60:
                raise RuntimeError("driven into a corner")
            continue
        fails, rows, now, last = 0, rows + new, t1, (v, w)
    done = np.array([*rows, (round(now, 4), 0.0, 0.0)])
    return Drive(done, n, start, ctx, travel(rob, sc.causes, done, n, start, ctx, noise, follow))


def _displaced(d: Drive, k: Cause, t: Array) -> Array:
    """Return how far to the east the reference is off where something unknown moves it."""
    p, (x, y, _) = k.p, d.way.at(t)
    hum = np.interp(t, (np.arange(d.n + 1) + 0.5) * DT, d.ctx["humidity"])
    shape = {
        "humidity": (hum - 45) / 8,
        "x": np.sin(p["k"] * x + p["f"]),
        "y": np.sin(p["k"] * y + p["f"]),
        "time": np.clip(4 * np.cos(2 * np.pi * (t / p["period"] + p["f"])) - 2, 0, 1),
    }
    return np.asarray(p["a"] * shape[p["of"]])


def reported(d: Drive, way: Way, t: Array, causes: list[Cause]) -> Pose:
    """Return mean poses of the reference at its stamps, of a way of the base."""
    c = {k.id: k for k in causes}
    if k := c.get("base.clock_scale"):
        t = t - k.p["scale"] * t * (0.5 + t / 240) if k.other else t / (1 + k.p["scale"])
    x, y, th = way.at(t)
    a, moves = th - d.way.at(t)[2], c.get("unknown.base.pose")
    dx = _displaced(d, moves, t) if moves else np.zeros_like(x)
    give = 0.25 * np.tanh(3 * way.cell("w", t))  # a mast that gives a little in turns (the other form)
    mx, my, mt = (
        c[i].p[name] * (1 + give * c[i].other) if i in c else 0
        for i, name in (("base.marker_x", "x"), ("base.marker_y", "y"), ("base.marker_yaw", "yaw"))
    )
    s, q = np.sin(th), np.cos(th)
    return x + np.cos(a) * dx + q * mx - s * my, y + np.sin(a) * dx + s * mx + q * my, th + mt


def laser_ctx(d: Drive) -> Context:
    """Return what the laser's errors may follow."""
    t = (np.arange(d.n + 1) + 0.5) * DT
    return {
        "temperature": lambda s: np.interp(s, t, d.ctx["temperature"]),
        "humidity": lambda s: np.interp(s, t, d.ctx["humidity"]),
        "v": lambda s: d.way.cell("v", s),
        "w": lambda s: d.way.cell("w", s),
    }


def _rounded(t: Array) -> Array:
    return np.asarray(np.round(t, 4))


def record(rng: Rng, sc: Scene, d: Drive) -> Drive:
    """Measure a drive: reference rows with their errors, and scans."""
    end, ref = d.n * DT, sc.ref
    t = np.arange(0.3, end - 0.5, 1 / ref.rate)
    t = _rounded(t + rng.uniform(-0.2, 0.2, len(t)) / ref.rate)
    keep = rng.random(len(t)) > 0.01
    for g in rng.uniform(10, end - 10, 2):
        keep &= np.abs(t - g) > rng.uniform(0.1, 0.5)
    t, grid = t[keep], np.arange(0, end + 1, 0.1)
    slow = np.stack([np.interp(t, grid, _wander(rng, len(grid), 0.1, ref.tau)) for _ in range(3)], 1)
    e, off = rng.standard_normal((len(t), 3)), (rng.random(len(t)) < 0.0008) & (np.arange(len(t)) > 0)
    poses = np.stack(reported(d, d.way, t, sc.causes), 1)
    poses = poses + e * (ref.sd, ref.sd, ref.sd_h) + slow * (ref.slow, ref.slow, ref.slow_h)
    poses[:, 0] += off * rng.uniform(0.05, 0.2, len(t)) * rng.choice([-1, 1], len(t))
    d = d._replace(tp=t, poses=poses, off=off)
    if sc.las:
        s = np.arange(0.6, end - 1.5, sc.las.period)
        s = _rounded(s + rng.uniform(-0.1, 0.1, len(s)) * sc.las.period)
        rd = readings(sc.las, sc.room, sc.causes, d.way.at, s, laser_ctx(d))
        d = d._replace(ts=s, scans=sample(sc.las, sc.causes, rd, s, rng))
    return d


def stage(rng: Rng, causes: list[Cause], volts: bool, need_laser: bool, limit: str) -> Scene:
    """Make a whole case: robot, room, laser, three or four drives."""
    rob = draw_robot(rng, volts, "published" if any(c.id == "base.steering_law" for c in causes) else "corrected")
    las = draw_laser(rng, rob.volts) if need_laser or rng.random() < 0.55 else None
    for c in causes:
        if c.id == "base.saturation":
            c.p["inverse_v"], c.p["inverse_w"] = c.p["inverse_v"] / rob.vmax, c.p["inverse_w"] / rob.wmax
    u, ref = float(np.exp(rng.uniform(-0.2, 0.3))), REFERENCES[int(rng.choice([0, 0, 1, 1, 2]))]
    ref = ref._replace(sd=ref.sd * u, sd_h=ref.sd_h * u)
    sc = Scene(rob, draw_room(rng, las.far if las else 20.0), ref, las, causes, [])
    for _ in range(int(rng.integers(3, 5))):
        sc.drives.append(record(rng, sc, drive(rng, sc, float(rng.uniform(95, 180)), limit)))
    return sc
