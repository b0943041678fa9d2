# SPDX-License-Identifier: BSD-3-Clause
"""The chair: laws (1) and (2), cells of 5 ms with held commands, causes by stage, exact arcs, the reference."""

import re
from dataclasses import dataclass, field
from functools import cache
from types import CodeType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[Any]
DT = 0.005
LAW_V = (1.32402, 0.127906, 2.07369, -0.108783)
LAW_W = (-0.499211, 0.104181, -0.469278, -0.169476)
RUNS = np.array([0.6, 1.4, 0.9, 1.6, 0.5, 1.2])
TOOLS: dict[str, Any] = vars(np).copy()
TOOLS |= {"abs": np.abs, "max": np.maximum, "min": np.minimum, "DT": DT, "LAW_V": LAW_V, "LAW_W": LAW_W, "RUNS": RUNS}


@dataclass(frozen=True)
class Line:
    """A line of a table: where it acts, the parameter that is sized and its range, the others', rules by form."""

    stage: str
    parameter: str
    low: float
    high: float
    signs: tuple[int, ...]
    others: dict[str, tuple[float, float]]
    forms: dict[str, str]


NO_LINE = Line("", "", 0.0, 0.0, (), {}, {})


@dataclass
class Hidden:
    """One thing that acts."""

    id: str
    form: str
    stage: str
    rule: str
    size: float = 1.0
    shape: dict[str, float] = field(default_factory=dict)
    line: Line = NO_LINE  # of what is in no table


@dataclass
class Run:
    """A drive: inputs by their stamps [s since its start], the noise of its rates, and after `drive` its path."""

    number: int
    start: float  # seconds since the recording began
    first: Array  # pose at t = 0
    stamps: Array
    commands: Array
    length: float
    noise: Array  # per cell: forward, yaw
    columns: dict[str, Any] = field(default_factory=dict)
    path: Any = None


def table(text: str, prefix: str = "") -> dict[str, Line]:
    """Read "name | stage parameter low high signs other:low:high each | plain rule | form: rule", broken anywhere."""
    out = {}
    for entry in text.strip().replace("\n  ", " ").split("\n"):
        name, head, plain, *others = entry.split(" | ")
        stage, parameter, low, high, signs, *more = head.split()
        forms = {"plain": plain, **dict(o.split(": ", 1) for o in others)}
        forms |= {"each run": plain} if "each" in more else {}
        limits = {k: (float(a), float(b)) for k, a, b in (m.split(":") for m in more if m != "each")}
        sign = {"+": (1,), "-": (-1,), "±": (-1, 1)}[signs]
        name = name if "." in name else prefix + name
        out[name] = Line(stage, parameter, float(low), float(high), sign, limits, forms)
    return out


@cache
def compiled(rule: str) -> list[tuple[str, CodeType]]:
    """Return the parts of a rule, "name = expression" or "name += expression" and the like."""
    parts = [re.findall(r"\A(\w+) ([-+*]?)= (.*)\Z", part)[0] for part in rule.split("; ")]
    return [(n, compile(f"{n} {sign} ({e})" if sign else e, n, "eval")) for n, sign, e in parts]


def apply(causes: list[Hidden], stage: str, s: SimpleNamespace) -> None:
    """Let the causes of a stage act on s; `a` is their size, the form "each run" has one for each run."""
    for c in causes:
        if c.stage == stage:
            size = c.size * (RUNS[s.run % 6] if c.form == "each run" else 1)
            known = {**TOOLS, **vars(s), **s.columns, **c.shape, "a": size, "s": s}
            for name, code in compiled(c.rule):
                setattr(s, name, eval(code, known))


def volts(rate: Array, law: tuple[float, ...]) -> Array:
    """Return volts by equations (1), (2)."""
    return np.where(rate > 0, law[0] * rate + law[1], np.where(rate < 0, law[2] * rate + law[3], 0.0))


def rates(volt: Array, sign: Array, law: tuple[float, ...]) -> Array:
    """Invert `volts` on the branch of the commanded sign; without one, a translation outside the dead zone drives."""
    up, down = np.maximum((volt - law[1]) / law[0], 0), np.minimum((volt - law[3]) / law[2], 0)
    none = np.where(volt > law[1], up, np.where(volt < law[3], down, 0.0)) if law[0] > 0 else 0.0 * volt
    return np.where(sign > 0, up, np.where(sign < 0, down, none))


def held(run: Run, count: int) -> Array:
    """Return the mean of the held command over each cell, exactly."""
    edges, knots = np.arange(count + 1) * DT, np.append(run.stamps, max(run.length, run.stamps[-1]) + 1.0)
    total = np.vstack(([0.0, 0.0], np.cumsum(run.commands * np.diff(knots)[:, None], axis=0)))
    out = np.stack([np.diff(np.interp(edges, knots, q, left=0.0)) / DT for q in total.T], 1)
    return np.where(np.abs(out) < 1e-9, 0.0, out)


def summed(x: Array, start: float = 0.0) -> Array:
    """Return the integral of x at the edges of its cells."""
    return start + np.concatenate(([0.0], np.cumsum(x) * DT))


def model(run: Run, causes: list[Hidden], theta: Array | None = None) -> SimpleNamespace:
    """Return rates per cell without noise; theta: the heading to use, or None for the one of the run's noise."""
    count = round(run.length / DT)
    command, t = held(run, count), (np.arange(count) + 0.5) * DT
    s = SimpleNamespace(
        t=t,
        run=run.number,
        all=run.start + t,
        columns=run.columns,
        vc=command[:, 0],
        wc=command[:, 1],
        vy=np.zeros(count),
        deep=None,
    )
    apply(causes, "cmd", s)
    s.vf, s.vs = volts(s.vc, LAW_V), volts(s.wc, LAW_W)
    apply(causes, "volt", s)
    s.v, s.w = rates(s.vf, s.vc, LAW_V), rates(s.vs, s.wc, LAW_W) if s.deep is None else s.deep
    apply(causes, "rate", s)
    apply(causes, "dyn", s)
    w = s.w + run.noise[:count, 1]
    s.theta = summed(w, run.first[2])[:-1] + w * DT / 2 if theta is None else theta
    apply(causes, "kin", s)
    return s


def drive(run: Run, causes: list[Hidden]) -> SimpleNamespace:
    """Return the true path, knots every cell joined by arcs, and keep it as run.path."""
    s = model(run, causes)
    v, w, vy = s.v + run.noise[: len(s.t), 0], s.w + run.noise[: len(s.t), 1], s.vy
    head = summed(w, run.first[2])
    middle, part = head[:-1] + w * DT / 2, np.sinc(w * DT / (2 * np.pi))
    c, q = part * np.cos(middle), part * np.sin(middle)
    x, y = summed(v * c - vy * q, run.first[0]), summed(v * q + vy * c, run.first[1])
    run.path = path = SimpleNamespace(v=v, w=w, vy=vy, head=head, middle=middle, model=s, x=x, y=y)
    return path


def cell(run: Run, t: Array) -> Array:
    """Return the cells of times."""
    return np.clip((np.asarray(t) / DT).astype(int), 0, len(run.path.v) - 1)


def pose(run: Run, t: Array) -> Array:
    """Return the true pose (..., 3) at any times, on the arc within the cell."""
    p, k = run.path, cell(run, t)
    turn = p.w[k] * (np.asarray(t) - k * DT)
    d, a = (np.asarray(t) - k * DT) * np.sinc(turn / (2 * np.pi)), p.head[k] + turn / 2
    c, s, v, vy = d * np.cos(a), d * np.sin(a), p.v[k], p.vy[k]
    return np.stack([p.x[k] + v * c - vy * s, p.y[k] + v * s + vy * c, p.head[k] + turn], -1)


def reference(run: Run, causes: list[Hidden], t: Array) -> Array:
    """Return what a reference without noise says in a row stamped t."""
    r = SimpleNamespace(t=t, taken=t, all=run.start + t, run=run.number, columns=run.columns)
    apply(causes, "clock", r)
    at, k = pose(run, np.clip(r.taken, 0, run.length)), cell(run, r.taken)
    r.x, r.y, r.theta, r.v, r.w = *np.moveaxis(at, -1, 0), run.path.model.v[k], run.path.model.w[k]
    apply(causes, "ref", r)
    return np.stack([r.x, r.y, r.theta], axis=-1)


def drift(run: Run, known: list[Hidden], t: Array, less: SimpleNamespace | None = None) -> Array:
    """Return the pose at t by a model less the true one (or less the model `less`), linear along the true path."""
    p, m = run.path, model(run, known, run.path.middle)
    dv, dw, dy = (getattr(m, n) - getattr(less or p, n) for n in ("v", "w", "vy"))
    c, s, turned = np.cos(p.middle), np.sin(p.middle), summed(dw)
    mid = turned[:-1] + dw * DT / 2
    ex, ey = dv * c - dy * s - mid * (p.v * s + p.vy * c), dv * s + dy * c + mid * (p.v * c - p.vy * s)
    edges = np.arange(len(turned)) * DT
    return np.stack([np.interp(t, edges, q) for q in (summed(ex), summed(ey), turned)], axis=-1)


def coloured(rng: np.random.Generator, count: int, tau: float) -> Array:
    """Return a stationary first-order process of variance 1, per cell."""
    a, z = np.exp(-DT / tau), rng.standard_normal(count)
    z[0] /= np.sqrt(1 - a * a)
    return np.asarray(lfilter([np.sqrt(1 - a * a)], [1, -a], z))
