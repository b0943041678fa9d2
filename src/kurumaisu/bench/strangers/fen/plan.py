# SPDX-License-Identifier: BSD-3-Clause
"""One case: its drives, its noise, its laser, what is hidden, of which size, and how well it shows."""

from dataclasses import dataclass, field

import numpy as np

from .base import ACTS, MARKERS, rates
from .drive import MONOTONE, STYLES, columns, commands, increments, measure, simulate, stamps
from .laser import MEAN, SHAPED, SPREAD, Fan, Look, look, moved, readings, signal, width
from .model import SLOPE, STEP, Cause, F, Noise, Run, follow, gains, project, project_all, whiten
from .room import Room, make_room
from .unknown import RANGE, RATES, REFERENCE, SCATTER, SORTS

LASER: dict[str, tuple[dict[str, float], tuple[str, ...]]] = {
    "mount_x": ({"x": 0.02}, ("x",)),
    "mount_y": ({"y": 0.02}, ("y",)),
    "mount_yaw": ({"yaw": 0.02}, ("yaw",)),
    "tilt": ({"pitch": 0.04, "roll": 0.04}, ()),
    "sweep": ({"stretch": 0.3}, ("stretch",)),
    "latency": ({"delay": 0.02}, ("delay",)),
    "clock_skew": ({"skew": 0.0005}, ("skew",)),
    "offset": ({"offset": 0.01}, ("offset",)),
    "scale": ({"scale": 0.005}, ("scale",)),
    "quadratic": ({"quadratic": 0.002}, ("quadratic",)),
    "warmup": ({"amplitude": 0.01, "tau": 35}, ("amplitude",)),
    "temperature": ({"coefficient": 0.0005}, ("coefficient",)),
    "reflectance": ({"bias": 0.02}, ("bias",)),
    "cyclic": ({"amplitude": 0.003, "wavelength": 1.5, "phase": 1.0}, ("amplitude",)),
    "incidence_bias": ({"k": 0.003}, ("k",)),
    "beam_bias": ({"sd": 0.001, "amplitude": 0.003, "phase": 1.0, "seed": 1.0}, ("sd", "amplitude")),
    "range_noise": ({"share": 0.3}, ("share",)),
    "incidence_noise": ({"gain": 0.5}, ("gain",)),
    "common_mode": ({"sd": 0.002, "rho": 0.8}, ("sd",)),
    "beam_correlation": ({"rho": 0.3}, ("rho",)),
    "heavy_tails": ({"inverse_nu": 0.25}, ("inverse_nu",)),
    "dropout": ({"probability": 0.04}, ("probability",)),
    "mixed_pixels": ({"probability": 0.6, "jump": 0.12}, ("probability",)),
    "saturation": ({"near": 0.1, "inverse_far": 0.3}, ()),
    "crosstalk": ({"probability": 0.3, "width": 0.3, "drift": 0.5, "reach": 4.0}, ("probability",)),
    "quantisation": ({"step": 0.004}, ()),
}
NOISY = (
    *SPREAD,
    *SCATTER,
    *(
        f"laser.{n}"
        for n in (
            "common_mode",
            "beam_correlation",
            "heavy_tails",
            "dropout",
            "mixed_pixels",
            "saturation",
            "crosstalk",
            "quantisation",
        )
    ),
)
TWINS = {"base.marker_y": "base.cross_w_to_v", "base.cross_w_to_v": "base.marker_y"}
SIZES = {
    "lag_v": (1, 4),
    "lag_w": (1, 4),
    "payload": (1, 4),
    "delay": (1, 4),
    "accel_limit": (1, 3),
    "saturation": (0.5, 1),
    "dead_zone_v": (0.3, 1),
    "dead_zone_w": (0.3, 1),
    "backlash": (0.3, 1),
    "dac_quantisation": (0.5, 1),
}
LIMITS = {
    "stretch": 1.0,
    "gain": 0.8,
    "rho": 0.95,
    "probability": 0.9,
    "inverse_nu": 0.4,
    "asymmetry": 0.8,
    "droop": 0.8,
    "share": 3.0,
    "delay": 0.5,
    "width": 0.4,
    "offset": 0.4,
    "step": 0.5,
    "k": 2.0,
    "lever": 0.5,
    "yaw": 0.4,
    "curvature": 1.0,
    "sag": 0.008,
    "kick": 1.5,
    "tau": 600.0,
    "growth": 60.0,
    "c": 0.5,
    "amplitude": 0.1,
}


class UnluckyError(Exception):
    """What was drawn does not show as it should."""


@dataclass
class Case:
    """What one recording is made of."""

    noise: Noise
    fan: Fan | None
    runs: list[Run]
    train: int
    causes: list[Cause]
    seed: int
    volts: bool
    style: str
    grey: bool = False
    room: Room | None = None
    told: list[F] = field(default_factory=list)
    scans: list[F] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    real: list[Look] = field(default_factory=list)
    rows: list[F] = field(default_factory=list)

    def finish(self, causes: list[Cause]) -> None:
        """Drive, measure, and scan with some causes."""
        self.causes, self.told, self.scans, self.looks, self.real = causes, [], [], [], []
        for r in self.runs:
            simulate(r, causes, self.noise)
        self.rows = [measure(r, causes, self.noise) for r in self.runs]
        if self.fan is not None:
            xy = [np.concatenate([k[::20] for k in q]) for q in ([r.x for r in self.runs], [r.y for r in self.runs])]
            self.room = make_room(xy[0], xy[1], np.random.default_rng(self.seed + 5), self.grey)
            self.scan(causes)

    def scan(self, causes: list[Cause]) -> None:
        """Scan with some causes."""
        assert self.room is not None
        assert self.fan is not None
        self.causes, self.told, self.scans, self.looks, self.real = causes, [], [], [], []
        real = moved(self.room, causes, self.seed)
        for r in self.runs:
            q = look(real, r, self.fan, causes)
            z, told = readings(q, causes, np.random.default_rng(r.seed + 2))
            self.scans.append(z)
            self.told.append(told)
            self.real.append(q)
            self.looks.append(look(self.room, r, self.fan, []))


def setting(seed: int, scans: bool, style: str = "", names: tuple[str, ...] = (), strong: float = 1.0) -> Case:
    """Draw drives, noise and a laser."""
    rng = np.random.default_rng(seed)
    noise = Noise(rng.uniform(0.005, 0.02), rng.uniform(0.01, 0.04), rng.uniform(0.15, 0.5), 0.0, 0.0)
    noise.position, noise.heading = rng.uniform(0.001, 0.015), rng.uniform(0.002, 0.015)
    n, m = int(rng.integers(2, 4)), int(rng.integers(1, 3))
    longs = rng.uniform(40, 110, n + m) if n + m > 3 else rng.uniform(60, 150, n + m)
    rate = min(float(rng.choice([5, 10, 20, 25, 40, 50])), 6500 / float(longs.sum()))
    fan, every = None, 1.0
    if scans:
        every, span = float(rng.choice([0.1, 0.2, 0.5, 1.0])), float(np.radians(rng.uniform(120, 360)))
        budget = float(np.exp(rng.uniform(np.log(15000), np.log(120000))))
        beams = int(np.clip(budget * every / longs.sum(), 60, rng.integers(60, 401)))
        every = min(max(every, float(longs.sum()) * beams / 150000), 1.0)
        fan = Fan(
            round(rng.uniform(0.0, 0.35), 3),
            round(rng.uniform(-0.1, 0.1), 3),
            round(rng.uniform(-0.1, 0.1), 4),
            round(-span / 2, 5),
            round(span / beams, 6),
            beams,
            round(rng.uniform(0.03, 0.09) / beams, 8),
        )
    start = float(rng.choice([0, rng.integers(10, 9000), 16e8 + rng.integers(10**8), 16e8 + rng.integers(10**8)]))
    runs, odd = [], rng.choice([*STYLES])
    for i, long in enumerate(longs):
        one = style or str(rng.choice([odd, *STYLES]))
        t, v, w = commands(one, float(long), float(rng.choice([10, 20, 25, 50])), rng)
        pose = (rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-3, 3))
        pt = stamps(float(long), rate, rng, rng.uniform(0.01, 0.2))
        st = stamps(float(long), 1 / every, rng, rng.uniform(0.1, 0.6)) if scans else np.zeros(0)
        if scans and i >= n:  # the scans to predict lie on rows of the reference
            at = np.clip(np.searchsorted(pt, st), 0, len(pt) - 1)
            st = np.unique(np.where(np.arange(len(st)) % 4 == 1, pt[at], st))
        r = Run(f"run_{i + 1}", start, pose, t, v, w, pt, st, seed * 100 + i * 10)
        r.column_t, r.columns = columns(float(long), list(names), rng)
        runs.append(r)
        start += float(np.ceil(long) + rng.integers(20, 400))
    return Case(noise, fan, runs, n, [], seed, bool(rng.random() < 0.4), style)


def plain(name: str, rng: np.random.Generator | None = None, form: int = 0) -> Cause:
    """A cause of the catalogue, of its usual size."""
    short = name.split(".")[1]
    if name.startswith("base."):
        p = dict(MARKERS.get(short) or ACTS[short][2])
        if rng is not None and short == "slope":
            a = rng.uniform(-np.pi, np.pi)
            p = {"climb_x": 0.02 * float(np.cos(a)), "climb_y": 0.02 * float(np.sin(a))}
        return Cause(name, p, form)
    if name == "world.map_error":
        moved_each = rng is not None and rng.random() < 0.5 and form == 0
        return Cause(name, {"sd": 0.005} if moved_each else {"scale": 0.004}, form)
    if name in SORTS:
        return Cause(name, {"a": SORTS[name].a, "q": float(rng.random()) if rng else 0.5}, form)
    p = dict(LASER[short][0])
    if rng is not None:
        for k in ("phase", "wavelength", "tau", "drift", "width", "pitch", "roll", "step", "inverse_far", "near"):
            if k in p:
                p[k] = round(p[k] * rng.uniform(0.6, 1.4), 4)
        p = {k: round(q, 3) if k == "step" else q for k, q in p.items()}
    return Cause(name, p, form)


def scaled(c: Cause, m: float) -> Cause:
    """A cause of another size."""
    short = c.id.split(".")[-1] if c.id not in SORTS else ""
    if c.id in SORTS:
        keys: tuple[str, ...] = ("a",)
    elif c.id.startswith("base."):
        keys = tuple(MARKERS[short]) if short in MARKERS else ACTS[short][3]
    else:
        keys = LASER[short][1] if short in LASER else tuple(c.p)
    return Cause(c.id, {k: v * m if k in keys else v for k, v in c.p.items()}, c.form)


def is_base(c: Cause) -> bool:
    """Whether it shows in the poses."""
    return c.id.startswith("base.") or c.id in RATES or c.id in REFERENCE


class Judge:
    """Inner products of signals in the metric of the noise."""

    def __init__(self, case: Case) -> None:
        self.case, self.runs = case, case.runs[: case.train]
        self.inc = [increments(r, case.causes) for r in self.runs]
        self.gain = [gains(r.pt, d, case.noise) for r, d in zip(self.runs, self.inc, strict=True)]
        self.near = [np.clip(np.searchsorted(r.pt, r.st), 1, len(r.pt) - 1) for r in self.runs]

    def base(self, pairs: list[tuple[list[Cause], list[Cause]]]) -> F:
        """Gram matrix of what the first causes of each pair do, and the second do not."""
        out = np.zeros((len(pairs), len(pairs)))
        for r, d, g in zip(self.runs, self.inc, self.gain, strict=True):
            known: dict[str, F] = {}

            def inc(cs: list[Cause], r: Run = r, known: dict[str, F] = known) -> F:
                key = repr(cs)
                if key not in known:
                    known[key] = increments(r, cs)
                return known[key]

            s = whiten(g, d, [inc(a) - inc(b) for a, b in pairs])
            out += s.T @ s
        return out

    def laser(self, causes: list[Cause]) -> F:
        """Gram matrix of first-order signals in the means of readings."""
        out, c = np.zeros((len(causes), len(causes))), self.case
        for i, k in enumerate(c.looks[: c.train]):
            cols = []
            for q in causes:
                if q.id == "world.map_error" and q in c.causes:
                    with np.errstate(invalid="ignore"):
                        e = SLOPE * (c.real[i].r - k.r)
                    cols.append(np.where((k.ok > 0) & (np.abs(e) < 0.1), e, 0.0))
                else:
                    cols.append(signal(k, q))
            s, sd = np.stack(cols, -1), np.sqrt(width(k, c.causes) ** 2 + STEP**2 / 12)
            wt = np.where(k.ok > 0, 1 / sd**2, 0.0)
            jw = k.j * wt[..., None]
            p = np.linalg.inv(self.gain[i].p[self.near[i]][:, :3, :3])
            m = np.linalg.inv(p + np.einsum("sbi,sbj->sij", jw, k.j))
            js = np.einsum("sbi,sbm->sim", jw, s)
            out += np.einsum("sbm,sb,sbn->mn", s, wt, s) - np.einsum("sim,sij,sjn->mn", js, m, js)
        return out

    def spread(self, causes: list[Cause]) -> F:
        """Gram matrix of changes of the readings' standard deviations."""
        out = np.zeros((len(causes), len(causes)))
        for k in self.case.looks[: self.case.train]:
            cols = [np.log(width(k, [c]) / width(k, [])) if c.id else k.r for c in causes]
            s = np.where(k.ok[..., None] > 0, np.nan_to_num(np.stack(cols, -1), posinf=0.0), 0.0)
            out += 2 * np.einsum("sbm,sbn->mn", s, s)
        return out

    def rates(self, c: Cause) -> tuple[float, float]:
        """The same of noise of the rates that grows, with noise of another size as the rival."""
        best, true, plain_ = -1e18, 0.0, 0.0
        for r, d, rows in zip(self.runs, self.inc, self.case.rows, strict=False):
            s = rates(r, [c])
            i = np.searchsorted(r.mid, r.pt[:-1]).clip(0, len(r.mid) - 1)
            g = gains(r.pt, d, self.case.noise, None, (s.grow_v[i], s.grow_w[i]))
            true += -0.5 * float((follow(g, d, rows)[0][1:] ** 2).sum()) - 0.5 * g.logdet
        for k in (1.0, 1.3, 1.7, 2.2, 3.0, 4.5):
            n, ll = self.case.noise, 0.0
            for r, d, rows in zip(self.runs, self.inc, self.case.rows, strict=False):
                g = gains(r.pt, d, Noise(n.v * k, n.w * k, n.tau, n.position, n.heading))
                ll += -0.5 * float((follow(g, d, rows)[0][1:] ** 2).sum()) - 0.5 * g.logdet
            plain_, best = (ll if k == 1.0 else plain_), max(best, ll)
        return float(np.sqrt(max(2 * (true - plain_), 0.0))), float(np.sqrt(max(2 * (true - best), 0.0)))


def rivals(c: Cause, scans: bool) -> list[Cause]:
    """Plain causes of the catalogue that might draw the same."""
    if is_base(c):
        out = []
        for n in [*ACTS, *MARKERS]:
            if f"base.{n}" in (c.id, TWINS.get(c.id), "base.process_noise", "base.steering_law"):
                continue
            out += [scaled(plain(f"base.{n}"), m) for m in SIZES.get(n, (1.0,))]
        return out if c.id == "base.slope" else [*out, Cause("base.slope", {"climb_x": 0.0, "climb_y": 0.02})]
    names = [n for n in (*SHAPED, *MEAN) if n not in (c.id, "laser.temperature", "laser.beam_bias", "laser.warmup")]
    out = [plain(n) for n in names]
    if c.id != "laser.cyclic":
        waves = [(w, f) for w in (0.5, 1.0, 2, 4) for f in (0, 1.57)]
        out += [Cause("laser.cyclic", {"amplitude": 0.003, "wavelength": w, "phase": f}) for w, f in waves]
    if c.id in RANGE:
        out += [Cause("laser.warmup", {"amplitude": 0.01, "tau": q}) for q in (10, 30, 90)]
    return out


def size(case: Case, c: Cause, target: float, rng: np.random.Generator) -> Cause:
    """A cause of the size that shows as wished, on the drives as they are."""
    if c.id in ("base.steering_law", "base.process_noise") or c.id in NOISY:
        return c
    free = c.id in SORTS or ACTS.get(c.id[5:], (0, 0, 0, 0, c.id[:5] != "base."))[4] or c.id[5:] in MARKERS
    c = scaled(c, -1.0 if free and rng.random() < 0.5 else 1.0)
    judge = Judge(case)
    if not is_base(c):
        z = float(np.sqrt(judge.laser([c])[0, 0]))
        if c.id == "laser.tilt":
            return Cause(c.id, {k: v * float(np.sqrt(target / z)) for k, v in c.p.items()}, c.form)
        return c if c.id == "world.map_error" or z == 0 else scaled(c, target / z)
    low, high, top = 0.0, 0.0, 1.0
    for _ in range(11):
        z = float(np.sqrt(judge.base([([*case.causes, scaled(c, top)], case.causes)])[0, 0]))
        if abs(z / target - 1) < 0.15:
            break
        low, high = (top, high) if z < target else (low, top)
        guess = top * float(np.clip(target / max(z, 1e-3), 0.1, 6.0))
        top = (low + high) / 2 if high and low and not low < guess < high else guess
    return scaled(c, top)


def monotone(rng: np.random.Generator) -> str:
    """A drive that is always the same."""
    return str(rng.choice(MONOTONE[:5]))


def project_one(gram: F, i: int, others: list[int]) -> tuple[float, float]:
    """Size of a signal, and what the best rival leaves of it."""
    return float(np.sqrt(gram[i, i])), project(gram, i, others)[0]


def shared(gram: F, i: int, others: list[int]) -> tuple[float, float]:
    """Size of a signal, and what all others together leave of it."""
    return float(np.sqrt(gram[i, i])), project_all(gram, i, others) if others else float(np.sqrt(gram[i, i]))
