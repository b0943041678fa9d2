# SPDX-License-Identifier: BSD-3-Clause
"""One attempt at a recording: a room, drivers, and hidden causes whose sizes are fitted to what they are to show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import laser
from .causes import BASE, LASER, TWINS, Cause
from .drive import Driver, Room, make_room
from .measure import Meter, Rows, beside, rows_of
from .noise import Noise, draw, wandering
from .plant import Array, H, Motion, Outside, simulate

FACTORS = (0.3, 1.0, 3.0)
LARGEST = 5.0
FREE = ("wander", "eights", "stops", "careful")
COVERED = {"base.slope", "base.saturation", "base.accel_limit"}  # each parameter has its own column


@dataclass
class Found:
    """A hidden cause with its size, its z, and what is left of it beside others."""

    cause: Cause
    size: float
    z: float = 0.0
    beside: float = 0.0
    near: str = ""
    members: tuple[str, ...] = ()
    doubtful: bool = False

    def again(self, least: float) -> bool:
        """Change the size if z or what is left beside others is out of the wanted range, but could be in it."""
        if (10 <= self.z <= 60 and self.beside >= least) or not self.cause.wide:
            return False
        k = max(11 / max(self.z, 0.5), 1.12 * least / max(self.beside, 0.3))
        k = min(k, 56 / max(self.z, 0.5))
        self.size = max(-LARGEST, min(LARGEST, self.size * min(max(k, 0.1), 4.0)))
        return k * self.beside >= least

    def fault(self) -> dict[str, float]:
        """Values of its fault."""
        return scaled(self.cause, self.size)


def scaled(cause: Cause, size: float) -> dict[str, float]:
    """Fault of a cause at a size."""
    return {k: v * size for k, v in cause.fault.items()}


def columns(causes: list[Cause]) -> tuple[list[dict[str, float]], dict[str, list[int]]]:
    """Faults of the catalogue for linearised signals, and which belong to which effect."""
    faults: list[dict[str, float]] = []
    groups: dict[str, list[int]] = {}
    for c in causes:
        parts = [{k: v} for k, v in c.fault.items()] if c.id in COVERED else [c.fault]
        if c.id == "world.map_error":
            parts = [{"map_scale": 0.002}]
        if c.id == "laser.tilt":  # apart: both together would be a scale
            parts = [{"pitch": 0.05}]
            groups["laser.tilt, roll"] = [len(faults)]
            faults.append({"roll": 0.05})
        groups[c.id] = list(range(len(faults), len(faults) + len(parts)))
        faults += parts
    return faults, groups


class Trial:
    """Everything about one recording before it is written."""

    def __init__(
        self,
        rng: np.random.Generator,
        causes: list[Cause],
        style: str,
        goal: tuple[float, float],
        scans: bool,
        least: float,
    ) -> None:
        self.rng, self.goal, self.scanned = rng, goal, scans
        self.logged: set[str] = set()
        self.log_hit = False
        self.full: dict[str, float] = {}
        self.room: Room = make_room(rng)
        self.noise: Noise = draw(rng)
        self.ends = rng.uniform(42, 58, 4)
        self.styles = [style or str(rng.choice(FREE)) for _ in range(4)]
        wish = [c.style for c in causes if c.style and not style]
        self.styles = [wish[0] if wish and i % 2 == 0 else s for i, s in enumerate(self.styles)]
        names = ("uneven", "gaps", "bursts", "off", "unix", "collision")
        self.flags = {n: bool(rng.random() < 1 / 6) for n in names}
        self.steps = int(self.ends.max() / H) + 1
        period = rng.uniform(0.07, 0.12)
        self.times = 0.1 + np.cumsum(period * rng.uniform(0.85, 1.15, int(self.ends.max() / period)))
        self.times = self.times[self.times < self.ends.max() - 0.1]
        self.outside()
        self.rows = [rows_of(rng, self.noise, e, self.flags) for e in self.ends]
        self.seeds = rng.integers(1 << 31, size=4)
        sizes = {c.why: float(rng.choice([-1, 1])) if c.signed else 1.0 for c in causes}
        self.base = [Found(c, sizes[c.why]) for c in causes if not c.laser]
        self.laser = [Found(c, sizes[c.why]) for c in causes if c.laser]
        if self.base:
            self.fit_base()
        self.run_base()
        if any(f.again(least) for f in self.base):
            self.run_base()
        self.make_scans()
        if self.laser:
            self.fit_laser()

    def outside(self) -> None:
        """What acts from outside."""
        rng, n = self.rng, self.steps
        noise = np.zeros((n, 3, 4))
        blocked, lost, gust, wander, pressure = (np.zeros((n, 4)) for _ in range(5))
        t = H * np.arange(n)
        self.hit = [(0.0, 0.0)] * 4
        for run in range(4):
            noise[:, 0, run] = wandering(rng, n, self.noise.sd_v, self.noise.tau)
            noise[:, 1, run] = wandering(rng, n, self.noise.sd_w, self.noise.tau)
            noise[:, 2, run] = wandering(rng, n, self.noise.sd_side, self.noise.tau)
            if self.flags["collision"] and run in (1, 3):
                start = rng.uniform(10, self.ends[run] - 8)
                self.hit[run] = (start, start + rng.uniform(1.0, 2.0))
                blocked[:, run] = (t > start) & (t < self.hit[run][1])
            for start in rng.uniform(3, 55, 7):
                lost[:, run] += (t > start) & (t < start + rng.uniform(0.3, 0.7))
                gust[:, run] += np.exp(-(((t - start) / 0.8) ** 2)) * rng.uniform(0.5, 1.5)
            wander[:, run] = 0.5 + 0.5 * np.sin(t / rng.uniform(1, 3) + rng.uniform(0, 6))
            pressure[:, run] = np.sin(t / rng.uniform(6, 14) + rng.uniform(0, 6))
        a = rng.uniform(0, 2 * np.pi)
        self.out = Outside(
            noise, blocked, lost, gust, wander, pressure, (float(np.cos(a)), float(np.sin(a))), self.ends
        )

    def simulate(self, variants: list[dict[str, float]], steps: int) -> Motion:
        """Drive all variants, with the same drivers each time."""
        drivers = [
            Driver(np.random.default_rng(s), self.room, self.styles[i], self.hit[i]) for i, s in enumerate(self.seeds)
        ]
        start = np.array([[*self.room.middle, a] for a in self.seeds / (1 << 31) * 6.28]).T
        shift = np.array([*self.room.middle, 0.0])[:, None]

        def drive(t: float, pose: Array) -> Array:
            pose = pose + shift
            return np.array([d.step(t, pose[:, i]) for i, d in enumerate(drivers)]).T

        motion = simulate(variants, self.times, steps, self.out, drive, start - shift)
        motion.pose += shift
        return motion

    def fit_base(self) -> None:
        """Sizes by driving with some sizes of each cause, by one driver."""
        variants: list[dict[str, float]] = [{}, {}]
        for f in self.base:
            variants += [scaled(f.cause, f.size * k) for k in FACTORS]
        short = 0 if any({"sag", "collapse", "lost", "gust"} & set(f.cause.fault) for f in self.base) else 24
        ends = np.minimum(self.ends, short) if short else self.ends
        m = self.simulate(variants, int(ends.max() / H) + 1)
        rows = [
            Rows(r.taken[i], r.stamp[i], r.error[i], r.off[i]) for r in self.rows for i in [r.taken < ends.min() - 0.1]
        ]
        rows = rows if short else self.rows
        meter = Meter(m, rows, self.noise, ends, self.room)
        signals: list[list[Array]] = []
        for run in meter.runs:
            zero = meter.increments(run, 1, {})
            signals.append([meter.increments(run, i, v) - zero for i, v in enumerate(variants) if i > 1])
        z = np.sqrt((meter.whitened(signals, self.times) ** 2).sum(axis=0)).reshape(-1, len(FACTORS)) + 1e-3
        z *= np.sqrt(self.ends[:3].sum() / ends[:3].sum())
        for f, row in zip(self.base, z, strict=True):
            f.size = max(-LARGEST, min(LARGEST, f.size * self.pick(row, f.cause.wide)))

    def pick(self, z: Array, wide: bool) -> float:
        """Factor that gives a z drawn from the wanted range."""
        goal = np.exp(self.rng.uniform(np.log(self.goal[0]), np.log(self.goal[1])))
        x, y = np.log(FACTORS), np.maximum.accumulate(np.log(z) + np.arange(len(z)) * 1e-9)
        at = float(np.interp(np.log(goal), y, x))
        if np.log(goal) < y[0]:
            at = x[0] - min((y[0] - np.log(goal)), 3.0)
        if np.log(goal) > y[-1]:
            at = x[-1] + min(np.log(goal) - y[-1], 0.7)
        return float(np.exp(np.clip(at, -0.1, 0.1))) if not wide else float(np.exp(at))

    def run_base(self) -> None:
        """The drive that is recorded, with what z needs beside it."""
        full = {k: v for f in self.base for k, v in f.fault().items()}
        less = [{k: v for g in self.base if g is not f for k, v in g.fault().items()} for f in self.base]
        extra, groups = columns(BASE + TWINS[:1]) if self.base else ([], {})
        variants = [full, {}, full, *less, *extra]
        self.full = full
        self.motion = self.simulate(variants, self.steps)
        self.meter = meter = Meter(self.motion, self.rows, self.noise, self.ends, self.room)
        if not self.base:
            return
        signals, first = [], 3 + len(less)
        for run in meter.runs:
            incs = [meter.increments(run, i, v) for i, v in enumerate(variants)]
            signals.append([incs[2] - incs[3 + i] for i in range(len(less))] + [x - incs[1] for x in incs[first:]])
        white = meter.whitened(signals, self.times)
        self.judge(self.base, white.T @ white, groups)

    def judge(self, found: list[Found], gram: Array, groups: dict[str, list[int]]) -> None:
        """Size z, and what is left of it beside each effect of the catalogue and each other cause."""
        for i, f in enumerate(found):
            f.z = float(np.sqrt(gram[i, i]))
            twin = f.cause.id in ("base.marker_y", "base.cross_w_to_v")
            names = [n for n in groups if n.split(",")[0] != f.cause.id and not (twin and n == "base.marker_y")]
            sets = [[len(found) + j for j in groups[n]] for n in names] + [[j] for j in range(len(found)) if j != i]
            names += [found[j].cause.id for j in range(len(found)) if j != i]
            left = beside(gram, i, sets)
            f.beside, f.near = min(zip(left, names, strict=True)) if left else (f.z, "")
            # the drives cannot tell them apart: below 3 of the noise; between 3 and 4.5 they might
            f.members = tuple(sorted({f.cause.id, *(n for n, x in zip(names, left, strict=True) if x < 3)}))
            if twin:
                f.members = tuple(sorted({*f.members, "base.marker_y", "base.cross_w_to_v"}))
            f.doubtful = any(3 <= x < 4.5 for x in left)

    def make_scans(self) -> None:
        """Scans of all runs at the reference's rate or less, and their faults."""
        rng = self.rng
        every, period = int(rng.integers(3, 7)), 1 / rng.uniform(2, 3.5)
        stamps = [np.arange(1.0, e - 1.0, period) + 0.1 * period * rng.uniform(-1, 1) for e in self.ends]
        t, run = np.concatenate(stamps), np.repeat(np.arange(4), [len(s) for s in stamps])
        self.warmth = np.sort(rng.uniform(16, 27, 4)) + rng.normal(0, 0.3, 4)
        self.switched = rng.uniform(30, 200) + np.cumsum(rng.uniform(150, 400, 4))
        beams = (laser.BEAMS + every - 1) // every
        self.scans = laser.Scans(
            t, run, every, H * np.arange(self.steps + 1), self.motion.pose, self.room, self.warmth[run],
            self.switched[run] + t, rng.normal(size=beams), rng.normal(size=(len(self.room.boxes), 2)),
        )  # fmt: skip
        moved = (np.clip(t / H, 0, self.steps - 1)).astype(int)
        self.speed = self.motion.v[moved, 0, run]
        if self.scanned:
            self.view = laser.look(self.scans, {})

    def level(self, fault: dict[str, float]) -> tuple[Array, Array]:
        """Mean and sd of readings with a fault."""
        view = laser.look(self.scans, fault) if set(fault) & laser.GEOMETRY else self.view
        return laser.level(self.scans, view, fault, self.speed)

    def fit_laser(self) -> None:
        """Sizes of the laser's causes, and what they show."""
        fit = self.scans.run < 3
        sd = (
            float(np.hypot(self.noise.position, self.noise.drift)),
            float(np.hypot(self.noise.heading, self.noise.drift_heading)),
        )
        base = self.level({})
        part = laser.View(*(getattr(self.view, n)[..., fit, :] for n in laser.View.__dataclass_fields__))

        def products(views: list[tuple[Array, Array]]) -> Array:
            return laser.gram(self.scans, part, (base[0][fit], base[1][fit]), [(a[fit], b[fit]) for a, b in views], sd)

        for f in self.laser:
            goal = np.exp(self.rng.uniform(np.log(self.goal[0]), np.log(self.goal[1])))
            for _ in range(4):
                z = (
                    self.far_off(f)[0]
                    if set(f.fault()) & laser.ODD
                    else float(np.sqrt(products([self.level(f.fault())])[0, 0]))
                )
                f.size *= float(np.clip((goal / max(z, 0.1)) ** (1.5 if set(f.fault()) & laser.ODD else 1.0), 0.05, 20))
                if "far" in f.fault():
                    f.size = float(np.clip(f.size, 0.97, 1.6))
        extra, groups = columns([c for c in LASER if not set(c.fault) & laser.ODD])
        gram = products([self.level(f.fault()) for f in self.laser] + [self.level(x) for x in extra])
        self.judge(self.laser, gram, groups)
        for f in self.laser:
            if set(f.fault()) & laser.ODD:
                f.z, f.beside = self.far_off(f)
            if "rho" in f.fault():
                rho = f.fault()["rho"]
                good = ~self.view.edge & (base[0] < 3.95)
                f.z = f.beside = float(np.sqrt(-np.sum(good[fit]) * np.log(1 - rho**2)))

    def far_off(self, f: Found) -> tuple[float, float]:
        """Of rare far readings: z, each beyond 5 sd counting 5 sd, and what is left if they may lie anywhere."""
        _, far = laser.read(np.random.default_rng(7), self.scans, self.view, f.fault(), self.speed)
        fit = (self.scans.run < 3)[:, None]
        n = float(np.sum(far & fit))
        place = {"mixed": self.view.edge, "wide": self.view.edge, "far": self.view.r > 3.5, "talk": self.view.r < 99}
        where = next((v for k, v in place.items() if k in f.fault()), None)
        share = 0.3 if where is None else max(np.sum(where & fit) / max(np.sum(fit * (self.view.r < 99)), 1), 1e-3)
        return 5 * np.sqrt(n), min(5 * np.sqrt(n), float(np.sqrt(2 * n * abs(np.log(min(share, 0.3))))))
