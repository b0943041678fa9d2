# SPDX-License-Identifier: BSD-3-Clause
"""A room with furniture, its distance field, and people who drive in it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from .catalogue import Effect
from .effects import simulate
from .plant import Arr, Noise, Run

CELL = 0.05


@dataclass
class Room:
    """Boxes (x, y, theta, length, thickness, reflectance) and the distance to the nearest on a grid."""

    boxes: Arr
    low: Arr
    grid: Arr

    def clear(self, x: Arr, y: Arr) -> Arr:
        """Distance to the nearest box."""
        i = np.clip(((x - self.low[0]) / CELL).astype(int), 0, self.grid.shape[0] - 1)
        j = np.clip(((y - self.low[1]) / CELL).astype(int), 0, self.grid.shape[1] - 1)
        return np.asarray(self.grid[i, j])

    def text(self) -> str:
        """The room as a Stage world."""
        out = ['define wall model ( color "gray30" gui_nose 0 )']
        for k, (x, y, a, m, b, s) in enumerate(self.boxes.tolist()):
            pose = f"[ {x:.4f} {y:.4f} 0 {np.degrees(a):.4f} ]"
            out.append(f'wall ( name "w{k + 1}" pose {pose} size [ {m:.4f} {b:.4f} 1.0 ] ranger_return {s:g} )')
        return "\n".join(out).replace("wall ( name", "model ( name") + "\n"


def furnish(rng: np.random.Generator, dark: bool = False) -> Room:
    """A room of 6 to 12 m with cupboards at the walls and a few things in the middle."""
    lx, ly = rng.uniform(6.5, 11.5), rng.uniform(6.0, 9.0)
    ox, oy = rng.uniform(-lx, 0.0), rng.uniform(-ly, 0.0)
    rows = [[lx / 2, -0.05, 0, lx + 0.2, 0.1], [lx / 2, ly + 0.05, 0, lx + 0.2, 0.1]]
    rows += [[-0.05, ly / 2, np.pi / 2, ly + 0.2, 0.1], [lx + 0.05, ly / 2, np.pi / 2, ly + 0.2, 0.1]]
    for _ in range(int(rng.integers(2, 5))):  # along the long walls
        m, b = rng.uniform(0.6, 1.8), rng.uniform(0.3, 0.6)
        up = bool(rng.integers(2))
        rows.append([rng.uniform(m / 2, lx - m / 2), ly - b / 2 if up else b / 2, 0.0, m, b])
    for _ in range(int(rng.integers(1, 4))):  # a table, a pillar, an open cupboard door
        near = rng.choice([0.22, 0.78])
        rows.append(
            [
                lx * near,
                rng.uniform(0.25, 0.75) * ly,
                rng.uniform(0, 3.1),
                rng.uniform(0.3, 1.2),
                rng.uniform(0.25, 0.6),
            ]
        )
    boxes = np.array([[*r, 1.0] for r in rows])
    boxes[:, 0] += ox
    boxes[:, 1] += oy
    if dark:
        boxes[4:, 5] = rng.choice([0.2, 0.5, 1.0], len(boxes) - 4)
        boxes[4, 5], boxes[1, 5] = 0.2, 0.5
    boxes[:, [0, 1, 3, 4]] = np.round(boxes[:, [0, 1, 3, 4]], 4)
    low = np.array([ox - 0.2, oy - 0.2])
    gx, gy = np.meshgrid(np.arange(0, lx + 0.4, CELL) + low[0], np.arange(0, ly + 0.4, CELL) + low[1], indexing="ij")
    grid = np.full(gx.shape, 9.0)
    for x, y, a, m, b, _ in boxes.tolist():
        u, w = (gx - x) * np.cos(a) + (gy - y) * np.sin(a), -(gx - x) * np.sin(a) + (gy - y) * np.cos(a)
        du, dw = np.abs(u) - m / 2, np.abs(w) - b / 2
        grid = np.minimum(grid, np.hypot(np.maximum(du, 0), np.maximum(dw, 0)) + np.minimum(np.maximum(du, dw), 0))
    return Room(boxes, low, grid)


@dataclass
class Driver:
    """How somebody drives. mode restricts what is driven (for confounded effects)."""

    top: float
    turn: float
    tick: float
    slew: float
    tremor: float
    habits: Arr
    mode: str = ""
    fixed: dict[str, float] = field(default_factory=dict)


HABITS = ("wander", "line", "spot", "eight", "back")


def somebody(rng: np.random.Generator, mode: str = "") -> Driver:
    """Draw a driver."""
    habits = rng.dirichlet([3.0, 2.0, 1.5, 2.0, 1.6]) + 0.05
    d = Driver(
        rng.uniform(0.5, 0.8),
        rng.uniform(0.6, 1.0),
        float(rng.choice([0.05, 0.1])),
        float(rng.choice([0.6, 1.5, 50.0])),
        float(rng.choice([0.0, 0.03])),
        habits / habits.sum(),
        "" if mode == "free" else mode,
    )
    if mode and mode != "free":
        d.slew, d.tremor = 50.0, 0.0
        d.fixed = {
            "v": round(rng.uniform(0.3, 0.6), 2),
            "w": round(rng.uniform(0.35, 0.7), 2),
            "k": rng.uniform(1.1, 1.6),
        }
    return d


def _limited(rng: np.random.Generator, d: Driver, n: int) -> tuple[Arr, Arr]:
    """A move of a drive that is restricted by the driver's mode."""
    one, u = np.ones(n), rng.uniform()
    way = float(rng.choice([-1.0, 1.0]))
    if d.mode == "one_speed":
        straight, spot = (d.fixed["v"] * one, 0 * one), (0 * one, way * rng.uniform(0.3, d.turn) * one)
        return straight if u < 0.6 else spot
    if d.mode == "one_rate":
        v = rng.uniform(0.1, d.top) * (one if u < 0.7 else 0 * one)
        return v, (d.fixed["w"] if rng.uniform() < 0.75 else 0.0) * one
    if d.mode == "left":
        v = rng.uniform(0.1, d.top) * (one if u < 0.6 else 0 * one)
        return v, (rng.uniform(0.15, d.turn) if rng.uniform() < 0.7 else 0.0) * one
    if d.mode == "back":
        return (
            (-rng.uniform(0.1, 0.4) * one, way * rng.uniform(0.0, 0.4) * one)
            if u < 0.7
            else (0 * one, way * rng.uniform(0.3, d.turn) * one)
        )
    v = rng.uniform(0.15, 0.6) * one  # arc: one curvature at all speeds
    return v, d.fixed["k"] * v


def _move(rng: np.random.Generator, d: Driver) -> tuple[Arr, Arr]:
    """One move: v and w at each tick."""
    n = int(rng.uniform(1.5, 4.5) / d.tick)
    t, one = np.arange(n) * d.tick, np.ones(n)
    way = float(rng.choice([-1.0, 1.0]))
    if d.mode:
        v, w = _limited(rng, d, n)
    else:
        habit = HABITS[int(rng.choice(5, p=d.habits))]
        v, w = rng.uniform(0.12, d.top) * one, way * rng.uniform(0.0, 0.8 * d.turn) * one
        if habit == "wander" and rng.uniform() < 0.6:
            w = way * rng.uniform(0.2, d.turn) * np.sin(2 * np.pi * t / rng.uniform(2.0, 6.0))
        elif habit == "line":
            w = 0 * one
        elif habit == "spot":
            v, w = 0 * one, way * rng.uniform(0.2, d.turn) * one
        elif habit == "eight":
            w0 = rng.uniform(0.4, d.turn)
            v, w = rng.uniform(0.2, 0.5) * one, w0 * way * np.where(t < n * d.tick / 2, 1, -1)
        elif habit == "back":
            v, w = -rng.uniform(0.1, 0.4) * one, (way * rng.uniform(0.0, 0.5) if rng.uniform() < 0.6 else 0.0) * one
    if rng.uniform() < (0.5 if d.mode else 0.3):
        rest = np.zeros(int(rng.uniform(0.5, 1.2) / d.tick))
        v, w = np.concatenate((v, rest)), np.concatenate((w, rest))
    if d.tremor:
        shake = np.asarray(lfilter([0.5], [1, -0.8], rng.normal(size=(2, len(v))), axis=1)) * d.tremor
        v, w = v + shake[0] * (v != 0), w + shake[1] * (w != 0)
    return np.clip(np.round(v, 2), -0.5, 0.8), np.clip(np.round(w, 2) if d.mode != "arc" else w, -1.0, 1.0)


def _slew(u: Arr, last: float, step: float) -> Arr:
    out = []
    for a in u.tolist():
        last += min(max(a - last, -step), step)
        out.append(round(last, 4))
    return np.array(out)


def _safe(room: Room, x: Arr, y: Arr, a: Arr, slack: float) -> bool:
    ahead = room.clear(x + 0.45 * np.cos(a), y + 0.45 * np.sin(a))
    return bool(room.clear(x, y).min() > 0.42 + slack and ahead.min() > 0.36 + slack)


def safe(room: Room, pose: Arr) -> bool:
    """Whether a true path keeps base_link and laser clear of everything."""
    x, y, a = pose[:, ::50]
    return bool(min(room.clear(x, y).min(), room.clear(x + 0.3 * np.cos(a), y + 0.3 * np.sin(a)).min()) > 0.12)


def _start(rng: np.random.Generator, room: Room, who: Driver) -> tuple[float, float, float]:
    """A pose with room about it; for circles of one radius, with the middle in the open."""
    a = rng.uniform(-np.pi, np.pi)
    arc = who.mode == "arc"
    i, j = np.nonzero(room.grid > min(9.9 if arc else 1.3, (0.9 if arc else 0.8) * room.grid.max()))
    k = int(rng.integers(len(i)))
    x, y = room.low[0] + (i[k] + 0.5) * CELL, room.low[1] + (j[k] + 0.5) * CELL
    radius = 1 / who.fixed["k"] if arc else 0.0
    return x + radius * np.sin(a), y - radius * np.cos(a), a


def drive(rng: np.random.Generator, room: Room, who: Driver, effects: list[Effect], noise: Noise, ram: bool) -> Run:
    """A drive of 40 to 70 s: each move is looked at from where the chair really is, then driven."""
    end = float(np.round(rng.uniform(40, 68), 1))
    n = round(end * 1000) + 2
    unit = np.empty((2, n))
    for k, tau in enumerate((noise.tv, noise.tw)):
        rho = np.exp(-0.001 / tau)
        first = rng.normal()
        unit[k] = lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=n), zi=[rho * first])[0]
    at = np.arange(n) / 1000
    column = np.sin(2 * np.pi * at / rng.uniform(14, 22) + rng.uniform(0, 6.3)) * 0.7 + 0.6 * np.sign(
        np.sin(at / rng.uniform(4, 8))
    )
    events = np.sort(rng.uniform(2, end - 3, int(rng.integers(8, 14))))
    v, w = [0.0] * int(1.0 / who.tick), [0.0] * int(1.0 / who.tick)
    run = Run(np.zeros(1), np.zeros(1), np.zeros(1), _start(rng, room, who), end, unit, column, events)
    hit, due = False, rng.uniform(0.3, 0.6) * end
    while len(v) * who.tick < end - 1.0:
        now = len(v) * who.tick
        run.tc, run.vc, run.wc = np.arange(len(v)) * who.tick, np.array(v), np.array(w)
        pose = simulate(run, effects, noise, 10, now).pose[:, -1]
        if ram and not hit and now > due:
            hit = _ram(room, who, run, pose, v, w)
            continue
        for k in range(40):
            mv, mw = _move(rng, who)
            mv, mw = _slew(mv, v[-1], who.slew * who.tick), _slew(mw, w[-1], 2 * who.slew * who.tick)
            a = pose[2] + np.cumsum(mw) * who.tick
            x, y = pose[0] + np.cumsum(mv * np.cos(a)) * who.tick, pose[1] + np.cumsum(mv * np.sin(a)) * who.tick
            if _safe(room, x, y, a, 0.2 - 0.005 * k):
                break
        else:
            mv = mw = np.zeros(int(0.5 / who.tick))
            if who.mode not in ("one_rate", "left", "arc"):
                mw = np.full(
                    int(rng.uniform(1, 2.5) / who.tick), round(rng.uniform(0.4, 0.7), 2) * float(rng.choice([-1, 1]))
                )
        v += mv.tolist()
        w += mw.tolist()
    m = int((end - 0.8) / who.tick)
    v, w = [*(v + [0.0] * m)[:m], 0.0], [*(w + [0.0] * m)[:m], 0.0]
    run.tc, run.vc, run.wc = np.arange(m + 1) * who.tick, np.array(v), np.array(w)
    return run


def _ram(room: Room, who: Driver, run: Run, pose: Arr, v: list[float], w: list[float]) -> bool:
    """Drive straight into what is ahead, stand there, and back off; False if nothing is near."""
    s = np.arange(0.7, 4.0, 0.02)
    near = np.flatnonzero(room.clear(pose[0] + s * np.cos(pose[2]), pose[1] + s * np.sin(pose[2])) < 0.05)
    go = (float(s[near[0]]) - 0.7) / 0.3 if len(near) else 99.0
    now = len(v) * who.tick
    if go > 8.0 or who.mode in ("back", "one_speed", "one_rate", "left", "arc"):
        return True
    stand, back = int((go + 2.5) / who.tick), int(2.5 / who.tick)
    v += [0.3] * stand + [0.0] * int(0.5 / who.tick) + [-0.2] * back
    w += [0.0] * (len(v) - len(w))
    run.stuck = (round(now + go, 3), round(now + (stand + 0.5 / who.tick) * who.tick - 0.01, 3))
    return True
