# SPDX-License-Identifier: BSD-3-Clause
"""Drives: a closed loop of decisions of about a second each, with noise and causes."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.marl.causes import Causes, size_of
from kurumaisu.bench.strangers.marl.motions import DT, at, clock, integrate, observe
from kurumaisu.bench.strangers.marl.rates import Cells, Covariates, filtered, moving, rates
from kurumaisu.bench.strangers.marl.rooms import Room, clearance, inside
from kurumaisu.bench.strangers.marl.things import Laser, Noise, Reference, Rng, Robot
from kurumaisu.types import FloatArray, IntArray

Command = tuple[float, float]


class Drive:
    """One drive; times count from its start."""

    def __init__(self, rng: Rng, index: int, robot: Robot, noise: Noise, start: float, duration: float) -> None:
        self.index, self.robot, self.noise, self.start, self.tails = index, robot, noise, start, 0.0
        n = round(duration / DT)
        self.duration, self.t = n * DT, (np.arange(n) + 0.5) * DT
        a = np.exp(-DT / noise.tau)
        z = rng.standard_normal((2, n)) * np.sqrt(1 - a * a)
        z[:, 0] /= np.sqrt(1 - a * a)
        self.disturbed = np.array([filtered(q, a) for q in z]) * [[noise.v], [noise.w]]
        self.vc, self.wc = np.zeros(n), np.zeros(n)
        self.v, self.w, self.path = np.zeros(n), np.zeros(n), np.zeros((3, 0))
        self.rows = np.zeros((0, 3))
        self.covariates: Covariates = {}
        self.laser: Laser | None = None
        self.tp, self.ts, self.poses = np.zeros(0), np.zeros(0), np.zeros((3, 0))  # as measured
        self.windows: tuple[IntArray, IntArray] = (np.zeros(0, int), np.zeros(0, int))  # rows of motions of a second
        self.scan_rows: IntArray = np.zeros(0, int)

    def cells(self, m: int | None = None) -> Cells:
        """Return the first m cells; a path that is shorter goes on at its end."""
        t = self.t[:m]
        p = self.path[:, : len(t) + 1]
        p = np.concatenate([p, np.repeat(p[:, -1:], len(t) + 1 - p.shape[1], 1)], 1)
        state = (p[:, 1:] + p[:, :-1]) / 2
        return Cells(t, self.vc[:m], self.wc[:m], state, self.robot, self.covariates, self.index)

    def rates(self, causes: Causes) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return mean v, w and sideways speed in each cell."""
        return rates(self.cells(), causes)

    def gain(self, v: FloatArray, w: FloatArray, causes: Causes) -> FloatArray:
        """Return factors of the noise: none at rest; they grow with the rates where that is hidden."""
        p = size_of(causes, "base.process_noise")
        shares = np.abs(v) / self.robot.v, np.abs(w) / self.robot.w
        return np.array([moving(v, w) * np.sqrt(1 + p * x**2) for x in shares])

    def simulate(self, causes: Causes, start: FloatArray, m: int | None = None) -> None:
        """Set the path with noise and causes; causes that follow the place see the path of the last pass."""
        if not self.path.size:
            self.path = np.repeat(start[:, None], 2, 1)
        for _ in range(2):
            v, w, u = rates(self.cells(m), causes)
            g = self.gain(v, w, causes)
            self.v, self.w = v + self.disturbed[0, :m] * g[0], w + self.disturbed[1, :m] * g[1]
            self.path = integrate((self.v, self.w, u), start)

    def command(self, rows: list[tuple[float, float, float]], i: int, j: int) -> None:
        """Set mean commands in cells i..j."""
        r = np.array(rows[-80:] if i else rows)
        e = np.arange(i, j + 1) * DT
        t = np.r_[r[:, 0], max(e[-1], r[-1, 0]) + 1]
        for q, x in ((self.vc, r[:, 1]), (self.wc, r[:, 2])):
            q[i:j] = np.diff(np.interp(e, t, np.r_[0, np.cumsum(x * np.diff(t))])) / DT
            q[i:j][np.abs(q[i:j]) < 1e-9] = 0


class Driver:
    """Who drives in a room: style 'auto' or 'joy', limited to 'one_speed', to 'left', or not."""

    def __init__(self, rng: Rng, d: Drive, room: Room, style: str, limit: str) -> None:
        self.rng, self.d, self.room, self.style, self.limit = rng, d, room, style, limit
        self.robot, self.margin = d.robot, d.robot.radius + 0.08
        self.corners = room.free[:2], room.free[2:]
        self.scale = min(1.0, 2 / (d.robot.v * 2.5 + 0.3))
        self.cmd: Command = (0.0, 0.0)
        self.goal = np.zeros(0)
        self.stop = self.back = 0
        self.rows = [(0.0, 0.0, 0.0)]
        self.pose = np.zeros(3)

    def start(self) -> bool:
        """Choose where to start, and how fast one drives; False where there is no room."""
        rng = self.rng
        for _ in range(300):
            self.pose = np.r_[rng.uniform(*self.corners), rng.uniform(-np.pi, np.pi)]
            if self._clear(self.margin + 0.25) and not inside(self.pose[:2], self.room.boxes):
                break
        else:
            return False
        self.hz = 10 if self.style == "auto" else int(rng.choice([10, 20]))
        self.fixed, self.turn = rng.uniform(0.45, 0.6) * self.robot.v, rng.uniform(0.3, 0.5) * self.robot.w
        self.pace, self.jitter = rng.uniform(0.6, 1), rng.uniform(0, 0.012)
        return True

    def _clear(self, by: float) -> bool:
        return bool(clearance(self.pose[None, :2], self.room.seg)[0] > by)

    def _candidates(self) -> list[Command]:
        rng, v, w = self.rng, self.robot.v, self.robot.w
        if self.limit == "one_speed":
            ahead = [(self.fixed, q) for q in np.linspace(-0.7, 0.7, 9) * w]
            return [*ahead, (0.0, self.turn), (0.0, -self.turn)]
        if self.limit == "left":
            left = [(q * v, z * w) for q in (0.3, 0.5, 0.8, 1) for z in (0, 0.1, 0.25, 0.5, 0.8)]
            return left + [(0.0, self.turn)] * 3
        f = rng.uniform(0.75, 1, 24) * self.pace
        vv = np.repeat([-0.2, -0.35, -0.5, -0.6] if self.back else [0.25, 0.5, 0.8, 1.0], 6)
        ww = np.tile([-0.7, -0.3, -0.08, 0.08, 0.3, 0.7], 4) * rng.uniform(0.6, 1.2) * w
        some = [*zip(f * vv * v, ww, strict=True), (0.0, 0.5 * w), (0.0, -0.5 * w)]
        return [*some, self.cmd] if self.style == "joy" and any(self.cmd) else some

    def _plan(self) -> None:
        """Choose a goal, and whether to drive backward."""
        rng = self.rng
        if not self.goal.size or np.hypot(*(self.goal - self.pose[:2])) < 0.6 or rng.random() < 0.03:
            self.goal = rng.uniform(*self.corners)
        begin = not self.back and not self.limit and rng.random() < 0.07 * self.robot.back
        self.back = int(rng.integers(2, 5)) if begin else max(0, self.back - 1)

    def _liked(self, c: FloatArray, p: FloatArray) -> FloatArray:
        """Return how much commands are liked that lead along points p."""
        if self.style == "auto":
            bearing = np.arctan2(*(self.goal - p[:, 3]).T[::-1])
            e = np.abs((bearing - self.pose[2] - c[:, 1] + np.pi) % (2 * np.pi) - np.pi)
            return np.asarray(-e + 1.5 * np.abs(c[:, 0]) / self.robot.v + 0.5 * self.rng.random(len(c)))
        score = self.rng.random(len(c)) + 0.5 * (c[:, 0] != 0)
        score[-1] += 0.6 * (not self.limit and any(self.cmd))
        return np.asarray(score)

    def _choose(self) -> Command:
        self._plan()
        c, rng, robot = np.array(self._candidates()), self.rng, self.robot
        ahead = np.linspace(0.2, 2.4 * self.scale + 0.4, 7)
        th = self.pose[2] + c[:, 1:] * np.minimum(ahead, 1.2) / 2
        p = self.pose[:2] + np.stack([c[:, :1] * ahead * np.cos(th), c[:, :1] * ahead * np.sin(th)], 2)
        clear = clearance(p.reshape(-1, 2), self.room.seg).reshape(len(c), -1).min(1)
        ok = clear > self.margin
        score = self._liked(c, p) - 100 * ~ok + np.where(ok, 0, 5 * clear) - 0.2 * (np.abs(c[:, 0]) < 1e-6)
        if clear.max() <= self.margin and not self.limit:
            retreat = clear[0] < self.margin and rng.random() < 0.3
            return -0.3 * robot.v if retreat else 0.0, 0.5 * robot.w * rng.choice([-1, 1])
        v, w = c[score.argmax()]
        return v, w

    def _decide(self) -> Command:
        rng, limit = self.rng, self.limit
        if self.stop > 0 or (rng.random() < 0.05 and not limit) or (limit and rng.random() < 0.06):
            self.stop = self.stop - 1 if self.stop else int(rng.integers(1, 3))
            return 0.0, 0.0
        return self._choose()

    def _send(self, new: Command, k: int, m: int) -> None:
        """Add the rows of commands from the last one to a new one."""
        t = np.arange(k * DT, (k + m) * DT - 1e-9, 1 / self.hz)
        f = np.ones(len(t))
        if not self.limit:
            f = np.minimum(1, (np.arange(len(t)) + 1) / (4 if self.style == "auto" else 1))
        if len(t) > 1:
            t = t + np.r_[0, self.rng.uniform(0, self.jitter, len(t) - 1)]
        for a, b in zip(t, f, strict=True):
            v, w = (round(old + b * (to - old), 5) for old, to in zip(self.cmd, new, strict=True))
            self.rows.append((round(a, 6), v, w))
        self.cmd = new

    def drive(self, causes: Causes) -> bool:
        """Set the commands and the path of the drive; False if it hits something."""
        if not self.start():
            return False
        d, n, k, start = self.d, len(self.d.t), int(1.5 / DT), self.pose
        while k < n - int(1 / DT):
            length = self.rng.choice([0.6, 1.0, 1.4] if self.style == "joy" else [0.5, 0.7])
            m = min(int(length / DT), n - k)
            self._send(self._decide(), k, m)
            d.command(self.rows, k, k + m)
            k += m
            d.simulate(causes, start, k)
            self.pose = d.path[:, k]
            if not self._clear(self.robot.radius * 0.8):
                return False
        self.rows.append((round(k * DT, 6), 0.0, 0.0))
        d.rows = np.array(self.rows)
        d.command(self.rows, 0, n)
        for _ in range(3):
            d.simulate(causes, start)
        return True


def _wandering(rng: Rng, t: FloatArray, tau: float) -> FloatArray:
    z, a = rng.standard_normal((3, len(t))), np.exp(-np.diff(t) / tau)
    e = z.copy()
    for k in range(1, len(t)):
        e[:, k] = a[k - 1] * e[:, k - 1] + np.sqrt(1 - a[k - 1] ** 2) * z[:, k]
    return e


def _stamps(rng: Rng, d: Drive, hz: float) -> FloatArray:
    """Return when poses are measured: now and then not."""
    t = np.arange(0.05, d.duration - 0.05, 1 / hz)
    t = t + rng.uniform(-0.25, 0.25, len(t)) / hz * (0.3 if hz > 50 else 1)
    keep = rng.random(len(t)) > 0.01
    for _ in range(rng.integers(0, 3)):
        a = rng.uniform(5, d.duration - 5)
        keep &= ~((t > a) & (t < a + rng.uniform(0.6, 2.0)))
    return np.round(t[keep], 6)


def each_axis(pair: tuple[float, float]) -> FloatArray:
    """Return a value for positions and one for headings as a column for x, y and heading."""
    return np.array([[pair[0]], [pair[0]], [pair[1]]])


def measure(rng: Rng, d: Drive, ref: Reference, causes: Causes) -> None:
    """Set the poses as measured, and their motions of about a second."""
    t = _stamps(rng, d, ref.hz)
    d.tp = np.round(t * (1 + size_of(causes, "base.clock_scale")), 6)
    mean = observe(at(d.path, clock(d.tp, causes)), causes)
    wander = _wandering(rng, t, ref.tau) * each_axis(ref.wander)
    d.poses = mean + wander + rng.standard_normal(wander.shape) * each_axis(ref.white)
    rows = [0]
    while (j := int(np.searchsorted(d.tp, d.tp[rows[-1]] + 1 - 0.5 / ref.hz))) < len(t):
        rows.append(j)
    i = np.array(rows)
    near = np.diff(d.tp[i]) < 1.6
    d.windows = i[:-1][near], i[1:][near]


def time_scans(rng: Rng, d: Drive, every: float) -> None:
    """Set when scans are taken: with a pose each."""
    s = np.arange(1.0, d.duration - 1.5, every) + rng.uniform(0, 0.02)
    j = np.unique(np.clip(np.searchsorted(d.tp, s), 0, len(d.tp) - 1))
    d.scan_rows = j[(d.tp[j] > 0.6) & (d.tp[j] < d.duration - 0.8)]
    d.ts = d.tp[d.scan_rows]
