# SPDX-License-Identifier: BSD-3-Clause
"""One experiment: drives are made with the causes acting, and the causes are sized until they show enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from . import causes as table
from . import drive, laser
from .causes import Plan, is_base
from .noise import Noise, Whitener
from .noise import draw as draw_noise
from .odd import events
from .plant import DT, Arr, Cause, Path, Run, increments, measure, simulate
from .world import Room, make_room

FLAWS = ("jitter", "gaps", "bursts", "off", "drift", "uneven", "unix", "collision")


@dataclass
class Score:
    """How much a cause shows, and how much of that no other effect explains."""

    z: float
    beside: float


class Lab:
    """The robot, its room, four runs, and the two whitenings."""

    def __init__(self, rng: np.random.Generator, todo: Plan) -> None:
        self.rng, self.plan, self.causes = rng, todo, list(todo.causes)
        self.flaws = {f: bool(rng.random() < 1 / 6) for f in FLAWS}
        self.noise: Noise = draw_noise(rng, self.flaws["jitter"], self.flaws["drift"])
        self.room: Room = make_room(rng, todo.dark)
        self.fan = laser.Fan(int(rng.integers(3, 7)), 0.30 + float(rng.choice([0.0, 0.05])))
        self.scan_rate, self.pose_rate = rng.uniform(2.0, 3.5), float(np.exp(rng.uniform(np.log(10), np.log(50))))
        self.driver = drive.draw(rng, todo.mode)
        if any("saturation" in c.id for c in self.causes):
            self.driver.v_max = max(self.driver.v_max, 0.7)
        self.length = rng.uniform(40, 68, 4)
        self.start = np.cumsum(np.concatenate([[rng.uniform(1, 15)], self.length[:3] + rng.uniform(60, 500, 3)]))
        self.make_columns()
        self.crash = int(rng.integers(1, 4)) if self.flaws["collision"] and todo.mode == "free" else 0
        self.seeds = rng.integers(1 << 40, size=4)
        self.stamps = [self.pose_times(s) for s in self.length]
        self.scan_times = [np.arange(rng.uniform(0.2, 0.6), s - 0.8, 1 / self.scan_rate) for s in self.length]
        shape = [(len(t), len(self.fan.bearing)) for t in self.scan_times]
        self.dice = [laser.throw(np.random.default_rng(int(s) + 1), n) for s, n in zip(self.seeds, shape, strict=True)]
        self.runs: list[Run] = []
        self.paths: list[Path] = []

    def make_columns(self) -> None:
        """What else was logged: functions of the time since the beginning, every 0.2 s."""
        rng, end = self.rng, float(self.start[-1] + self.length[-1] + 5)
        t = np.arange(0, end, 0.2)

        def smooth(knot: float) -> Arr:
            k = np.arange(0, end + 3 * knot, knot)
            return np.asarray(CubicSpline(k, rng.uniform(-1, 1, len(k)))(t))

        seed = int(next((c.p["seed"] for c in self.causes if c.id == "odd.gust"), rng.integers(1000)))
        self.column_time, self.columns = t, {
            "temperature": 21 + 3 * smooth(120) + rng.uniform(-1, 3),
            "battery": 25.4 - t * rng.uniform(2e-4, 2e-3) + 0.03 * smooth(3),
            "tyre_pressure": 2.4 + 0.15 * smooth(25), "lean": np.clip(smooth(7), -1.2, 1.2),
            "humidity": 45 + 6 * smooth(100),
            "lamp": (smooth(16) > 0).astype(float), "wind": events(t, seed, 6.0, 1.5) * (1 + 0.1 * smooth(2)),
            "seat_load": 71 + 0.4 * smooth(9),
        }  # fmt: skip

    def column(self, name: str, t: Arr) -> Arr:
        """A logged quantity at other times."""
        return np.interp(t, self.column_time, self.columns[name])

    def pose_times(self, seconds: float) -> Arr:
        """When the reference measures: regular or not, with gaps and bursts."""
        rng, dt = self.rng, 1 / self.pose_rate
        steps = np.full(int(seconds / dt) + 1, dt)
        if self.flaws["uneven"]:
            steps *= np.exp(0.4 * rng.standard_normal(len(steps)))
        t = rng.uniform(0.0, 0.3) + np.cumsum(steps)
        if self.flaws["bursts"]:
            at = rng.choice(t, 12, replace=False)
            t = np.sort(np.concatenate([t, *(at + 0.003 * k for k in (1, 2, 3))]))
        if self.flaws["gaps"]:
            for at in rng.uniform(5, seconds - 5, 3):
                t = t[(t < at) | (t > at + rng.uniform(0.7, 1.4))]
        return np.asarray(t[(t < seconds - 0.3) & (np.diff(t, prepend=-1.0) > 5e-4)])

    def go(self) -> None:
        """Make the four runs with the causes as they are now; the same seeds each time."""
        self.runs, self.commands = [], []
        self.fluctuations = []
        base = [c for c in self.causes if is_base(c)]
        for i in range(4):
            rng = np.random.default_rng(int(self.seeds[i]))
            n = int(self.length[i] / DT) + 200
            noise = self.noise.rates(rng, n)
            t = self.start[i] + np.arange(n) * DT
            columns = {k: self.column(k, t) for k in ("lean", "wind", "tyre_pressure")}
            run, stamps = drive.make_run(
                rng,
                self.room,
                self.driver,
                base,
                noise,
                self.noise.at_rest,
                self.length[i],
                self.start[i],
                columns,
                0 < i == self.crash,
            )
            self.runs.append(run)
            self.commands.append(stamps)
            self.fluctuations.append(noise)
        self.follow()

    def follow(self) -> None:
        """What really happens, with noise."""
        base = [c for c in self.causes if is_base(c)]
        self.paths = [
            simulate(r, base, n[: len(r.v)] * drive.activity(r, self.noise.at_rest)[:, None])
            for r, n in zip(self.runs, self.fluctuations, strict=True)
        ]

    def clear(self) -> float:
        """The smallest clearance of base_link in runs without a collision."""
        return min(
            float(self.room.clearance(p.pose[:, :2]).min()) for i, p in enumerate(self.paths) if not 0 < i == self.crash
        )

    def prepare(self) -> None:
        """Build the filters for the runs to fit."""
        todo = []
        base = [c for c in self.causes if is_base(c)]
        for run, path, t in zip(self.runs[:3], self.paths, self.stamps, strict=False):
            speed = np.stack([np.interp(t, run.t, path.v), np.interp(t, run.t, path.w)], axis=1)
            total = np.concatenate([[0.0], np.cumsum(drive.activity(run, self.noise.at_rest))])
            at = np.interp(t, np.arange(len(total)) * DT, total)
            todo.append((t, measure(path, t, base), speed, np.diff(at) * DT / np.diff(t)))
        self.filter = Whitener(self.noise, todo)
        if self.plan.scans:
            self.plain = [self.scene(i, []) for i in range(3)]
            self.cast = {"[]": self.plain}
            self.readings = laser.Readings(self.plain, self.dice[:3], self.noise)

    def scene(self, i: int, causes: list[Cause]) -> laser.Scene:
        """What the scans of a run meet."""
        t = self.scan_times[i]
        columns = {k: self.column(k, self.start[i] + t) for k in ("temperature", "lamp")}
        return laser.look(self.paths[i], t, self.start[i], laser.really(self.room, causes), self.fan, causes, columns)

    def steps(self, causes: list[Cause]) -> list[Arr]:
        """Increments of the runs to fit without noise; the floor is read where the chair really was."""
        base = [c for c in causes if is_base(c)]
        return [
            increments(measure(simulate(r, base, None, p.pose), t, base))
            for r, p, t in zip(self.runs[:3], self.paths, self.stamps, strict=False)
        ]  # fmt: skip

    def change(self, causes: list[Cause], fewer: list[Cause]) -> tuple[Arr, Arr]:
        """Whitened signal of some causes beside others: in the increments, in the readings."""
        base = np.zeros(3)
        if [c for c in causes if is_base(c)] != [c for c in fewer if is_base(c)]:
            a, b = self.steps(causes), self.steps(fewer)
            base = self.filter.apply([(x - y)[..., None] for x, y in zip(a, b, strict=True)])[:, 0]
        seen, less = ([c for c in group if not is_base(c)] for group in (causes, fewer))
        if seen == less:
            return base, np.zeros(0)
        return base, self.readings.change(self.scenes(seen), seen, self.scenes(less), less)

    def scenes(self, causes: list[Cause]) -> list[laser.Scene]:
        """Scenes of the runs to fit; cast again only if the causes move the beams, and each only once."""
        moves = ("laser.mount", "laser.tilt", "laser.sweep", "laser.latency", "laser.clock_skew", "world.")
        key = str([(c.id, c.p) for c in causes if c.id.startswith(moves)])
        if key not in self.cast:
            self.cast[key] = [self.scene(i, causes) for i in range(3)]
        return self.cast[key]

    def size(self, rounds: int) -> None:
        """Scale each cause until its z is the wanted one (secant in logarithms)."""
        for i, goal in enumerate(self.plan.targets):
            slope, step, before = 1.0, 0.0, 0.0
            for k in range(rounds):
                others = [c for j, c in enumerate(self.causes) if j != i]
                z = float(np.log(max(norm(self.change(self.causes, others)), 1e-3)))
                if not self.causes[i].keys or abs(z - np.log(goal)) < 0.06:
                    break
                if k and abs(step) > 1e-6:
                    slope = float(np.clip((z - before) / step, 0.4, 12.0))
                step, before = float(np.clip((np.log(goal) - z) / slope, -1.2, 1.2)), z
                self.causes[i] = self.causes[i].scaled(float(np.exp(step)))

    def others(self, moves: bool) -> tuple[list[tuple[str, Arr]], list[tuple[str, Arr]]]:
        """Whitened signals of the catalogue: for the increments, for the readings."""
        groups = table.rivals() if moves else []
        if not groups:
            return [], self.readings.rivals()
        plain = self.steps([])
        flat = [c for g in groups for c in g.causes]
        each = [self.steps([c]) for c in flat]
        white = self.filter.apply([np.stack([e[r] - plain[r] for e in each], axis=-1) for r in range(3)])
        base, k = [], 0
        for g in groups:
            base.append((g.id, white[:, k : k + len(g.causes)]))
            k += len(g.causes)
        return base, self.readings.rivals() if self.plan.scans else []

    def scores(self) -> tuple[list[Score], list[list[tuple[str, float, bool]]]]:
        """Of each cause its z and beside, and the residual by each rival with whether its sign is possible."""
        base, seen = self.others(any(is_base(c) for c in self.causes))
        signals = [
            self.change(self.causes, [c for j, c in enumerate(self.causes) if j != i]) for i in range(len(self.causes))
        ]
        scores, left = [], []
        for i, c in enumerate(self.causes):
            part = 0 if is_base(c) else 1
            s = signals[i][part]
            rest = [(n, *residual(s, x)) for n, x in (base, seen)[part] if n != c.id]
            pairs = [
                residual(s, signals[j][part][:, None])[0]
                for j, o in enumerate(self.causes)
                if j != i and is_base(o) == is_base(c)
            ]
            z = float(np.linalg.norm(s))
            scores.append(Score(z, min([z, *pairs, *(r for _, r, _ in rest)])))
            left.append(rest)
        return scores, left


def norm(parts: tuple[Arr, Arr]) -> float:
    """Norm of both parts."""
    return float(np.sqrt(sum(float(p @ p) for p in parts)))


def residual(s: Arr, x: Arr) -> tuple[float, bool]:
    """What least squares leave of s, and whether the first coefficient is positive."""
    x = x[:, np.any(x != 0, axis=0)]
    if x.shape[1] == 0:
        return float(np.linalg.norm(s)), False
    coefficient = np.linalg.lstsq(x, s, rcond=None)[0]
    return float(np.linalg.norm(s - x @ coefficient)), bool(coefficient[0] > 0)
