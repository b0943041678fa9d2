# SPDX-License-Identifier: BSD-3-Clause
"""A robot in a room: its drives, its reference, its scans."""

from collections import namedtuple
from dataclasses import dataclass
import numpy as np
from scipy.signal import lfilter
from kurumaisu.bench.strangers.fell.laser import Laser, draw_laser, readings, sample
from kurumaisu.bench.strangers.fell.plant import DT, Cause, Robot, Way, travel
from kurumaisu.bench.strangers.fell.room import Room, draw_room

# what measures the poses: rate, white noise of places and headings, slow wander of both and its time
Reference = namedtuple("Reference", "name rate sd sd_h slow slow_h tau")
REFERENCES = (
    Reference("motion capture", 25, 0.0012, 0.002, 0.0012, 0.0010, 30),
    Reference("scan matching", 10, 0.006, 0.004, 0.005, 0.003, 20),
    Reference("total station, two prisms", 8, 0.003, 0.005, 0.001, 0.001, 40),
)
# one drive: what was asked for, where it was; poses measured, which are off; scans
Drive = namedtuple("Drive", "rows n start ctx way tp poses off ts scans", defaults=[np.zeros(0)] * 5)


@dataclass
class Scene:
    """All of a case."""

    robot: Robot
    room: Room
    ref: Reference
    las: Laser | None
    causes: list[Cause]
    drives: list[Drive]


def draw_robot(rng: np.random.Generator, volts: bool, law: str) -> Robot:
    """The wheelchair, or one of the usual differential robots."""
    sd, style = float(np.exp(rng.uniform(0, 0.5))), str(rng.choice(["person", "auto", "script"]))
    if volts or rng.random() < 0.35:
        kind = "chair" if rng.random() < 0.7 else "chair by v, w"
        return Robot(kind, True, 0.8, 0.9, law, 0.008 * sd, 0.012 * sd, 0.25, 10, 0.8, style, 0.42, "md100")
    name, v, w, size, rad, track, sv, ramp = (
        ("small", 0.26, 1.4, 0.12, 0.033, 0.16, 0.004, 0.8),
        ("lab", 0.7, 1.2, 0.26, 0.0975, 0.38, 0.007, 1.2),
        ("carrier", 1.0, 0.9, 0.35, 0.1, 0.5, 0.009, 1.0),
    )[int(rng.integers(3))]
    meta = "velocity" if rng.random() < 0.5 else f"{{kind: diff_drive, radius: {rad}, track: {track}}}"
    rate = float(rng.choice([10, 15, 20]))
    return Robot(name, False, v, w, law, sv * sd, 0.014 * sd, 0.2, rate, ramp, style, size, meta)


def _ou(rng: np.random.Generator, n: int, dt: float, tau: float) -> np.ndarray:
    a, e = np.exp(-dt / tau), rng.standard_normal(n)
    e[1:] *= np.sqrt(1 - a * a)
    return lfilter([1], [1, -a], e)


def _segment(rng: np.random.Generator, rob: Robot, limit: str, fails: int) -> tuple[float, float, float]:
    """What the driver does next: speed, rate of turn, for how long; in a corner it turns."""
    if fails > 8 and limit != "speed":
        w = 0.5 * rob.wmax if limit == "left" else 0.8 * rob.wmax * (1 if fails % 2 else -1)
        return 0.0, w, rng.uniform(1, 4)
    if limit == "speed":
        return 0.5 * rob.vmax, float(rng.choice([0, 0.35, -0.35, 0.6, -0.6, 0.9, -0.9])) * rob.wmax, rng.uniform(1.5, 4)
    kind = rng.choice(6, p=[0.12, 0.16, 0.2, 0.34, 0.10, 0.08])
    lv = (lambda: rng.uniform(0.12, 1)) if rob.style == "person" else (lambda: rng.choice([0.15, 0.35, 0.6, 1.0]))
    v, w = lv() * rob.vmax, lv() * rob.wmax * rng.choice([-1, 1])
    if rob.volts:
        w = np.sign(w) * max(abs(w), 0.2)
    w, arc = (0.5 * rob.wmax, 1.0) if limit == "left" else (w, 0.7)
    v, w = ((0, 0), (0, w), (v, 0), (v, w * arc), (-v * 0.5, 0), (-v * 0.5, w * max(arc, 0.5)))[kind]
    return float(v), float(w), rng.uniform(1, 3) if kind == 0 else rng.uniform(1.5, 5)


def drive(rng: np.random.Generator, sc: Scene, T: float, limit: str) -> Drive:
    """Drives about as one does who sees the walls: what would come too close is not done."""
    rob, room, n = sc.robot, sc.room, int(T / DT)
    t, u, ph = (np.arange(n + 1) + 0.5) * DT, rng.uniform(50, 110), rng.uniform(0, 6)
    ctx = {k: np.zeros(n + 1) for k in ("th", "x", "y")}
    ctx["humidity"] = 45 + 9 * np.sin(2 * np.pi * t / u + ph) + 3 * np.sin(2 * np.pi * t / (u * 0.37) + 2 * ph)
    ctx["temperature"] = 22 + rng.uniform(3, 6) * np.sin(2 * np.pi * t / rng.uniform(120, 260) + ph)
    noise = np.stack([_ou(rng, n + 1, DT, rob.tau), _ou(rng, n + 1, DT, rob.tau)])
    margin, at = rob.size + 0.06, rng.uniform(0, 1, (400, 2)) * (room.width, room.height)
    at = at[room.clearance(at[:, 0], at[:, 1]) > margin + (0.25 if limit != "speed" else 0.8)]
    if not len(at):
        raise RuntimeError("no room to begin")
    start = (*at[0], rng.uniform(-np.pi, np.pi))
    rows = [(0.05 + k / rob.rate, 0.0, 0.0) for k in range(int(2 * rob.rate))]
    now, last, fails, lean = 2.05, (0.0, 0.0), 0, 0.0
    follow = 4 if any(k.id.startswith("unknown.base") or k.id == "base.slope" for k in sc.causes) else 1
    slew = rob.ramp * (1e3 if rob.style == "script" or limit == "speed" else 1.0) / rob.rate
    while now < T - 3:
        seg = _segment(rng, rob, limit, fails)
        new, t1, (v, w) = [], now, last
        while t1 < now + seg[2]:
            hard = slew * (1 + 9 * (fails > 8))  # who comes too close brakes hard
            v, w = v + np.clip(seg[0] - v, -hard, hard), w + np.clip(seg[1] - w, -2.5 * hard, 2.5 * hard)
            lean = 0.9 * lean + 0.006 * rng.standard_normal() * (rob.style == "person" and not limit)
            new.append((round(t1, 4), round(v * (1 + lean), 4), round(w * (1 + 1.5 * lean), 4)))
            t1 += (1 + 0.08 * rng.uniform(-1, 1)) / rob.rate
        trial = travel(
            rob,
            sc.causes,
            np.array(rows + new + [(t1, 0.0, 0.0)]),
            min(int((t1 + 0.3) / DT), n),
            start,
            ctx,
            noise,
            follow,
        )
        left = room.clearance(trial.x[int(now / DT) :: 4], trial.y[int(now / DT) :: 4]).min()
        if left < margin - 0.06 * (fails > 30):
            fails += 1
            if fails > 60:
                raise RuntimeError("driven into a corner")
            continue
        fails, rows, now, last = 0, rows + new, t1, (v, w)
    rows.append((round(now, 4), 0.0, 0.0))
    return Drive(np.array(rows), n, start, ctx, travel(rob, sc.causes, np.array(rows), n, start, ctx, noise, follow))


def displaced(d: Drive, causes: list[Cause], t: np.ndarray) -> np.ndarray:
    """How far to the east the reference is off where something unknown moves it."""
    x, y, _ = d.way.at(t)
    out = np.zeros_like(x)
    for c in causes:
        if c.id == "unknown.base.pose":
            p, hum = c.p, np.interp(t, (np.arange(d.n + 1) + 0.5) * DT, d.ctx["humidity"])
            out += (
                p["a"]
                * {
                    "humidity": (hum - 45) / 8,
                    "x": np.sin(p["k"] * x + p["f"]),
                    "y": np.sin(p["k"] * y + p["f"]),
                    "time": np.clip(4 * np.cos(2 * np.pi * (t / p["period"] + p["f"])) - 2, 0, 1),
                }[p["of"]]
            )
    return out


def reported(d: Drive, way: Way, t: np.ndarray, causes: list[Cause]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean poses of the reference at its stamps, of a way of the base."""
    c = {k.id: k for k in causes}
    if k := c.get("base.clock_scale"):
        t = t - k.p["scale"] * t * (0.5 + t / 240) if k.other else t / (1 + k.p["scale"])
    x, y, th = way.at(t)
    a, dx = th - d.way.at(t)[2], displaced(d, causes, t)
    give = 0.25 * np.tanh(3 * way.cell("w", t))  # a mast that gives a little in turns (the other form)
    mx, my, mt = (
        c[i].p[k] * (1 + give * c[i].other) if i in c else 0
        for i, k in (("base.marker_x", "x"), ("base.marker_y", "y"), ("base.marker_yaw", "yaw"))
    )
    s, q = np.sin(th), np.cos(th)
    return x + np.cos(a) * dx + q * mx - s * my, y + np.sin(a) * dx + s * mx + q * my, th + mt


def laser_ctx(d: Drive) -> dict:
    """What the laser's errors may follow."""
    t = (np.arange(d.n + 1) + 0.5) * DT
    return {
        "temperature": lambda s: np.interp(s, t, d.ctx["temperature"]),
        "v": lambda s: d.way.cell("v", s),
        "humidity": lambda s: np.interp(s, t, d.ctx["humidity"]),
        "w": lambda s: d.way.cell("w", s),
    }


def record(rng: np.random.Generator, sc: Scene, d: Drive) -> Drive:
    """Measures a drive: reference rows with their errors, and scans."""
    T, ref = d.n * DT, sc.ref
    t = np.arange(0.3, T - 0.5, 1 / ref.rate)
    t = np.round(t + rng.uniform(-0.2, 0.2, len(t)) / ref.rate, 4)
    keep = rng.random(len(t)) > 0.01
    for g in rng.uniform(10, T - 10, 2):
        keep &= np.abs(t - g) > rng.uniform(0.1, 0.5)
    t, grid = t[keep], np.arange(0, T + 1, 0.1)
    slow = np.stack([np.interp(t, grid, _ou(rng, len(grid), 0.1, ref.tau)) for _ in range(3)], 1)
    e, off = rng.standard_normal((len(t), 3)), (rng.random(len(t)) < 0.0008) & (np.arange(len(t)) > 0)
    poses = (
        np.stack(reported(d, d.way, t, sc.causes), 1)
        + e * (ref.sd, ref.sd, ref.sd_h)
        + slow * (ref.slow, ref.slow, ref.slow_h)
    )
    poses[:, 0] += off * rng.uniform(0.05, 0.2, len(t)) * rng.choice([-1, 1], len(t))
    d = d._replace(tp=t, poses=poses, off=off)
    if sc.las:
        s = np.arange(0.6, T - 1.5, sc.las.period)
        s = np.round(s + rng.uniform(-0.1, 0.1, len(s)) * sc.las.period, 4)
        rd = readings(sc.las, sc.room, sc.causes, d.way.at, s, laser_ctx(d))
        d = d._replace(ts=s, scans=sample(sc.las, sc.causes, rd, s, rng))
    return d


def stage(rng: np.random.Generator, causes: list[Cause], volts: bool, need_laser: bool, limit: str) -> Scene:
    """A whole case: robot, room, laser, three or four drives."""
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
