# SPDX-License-Identifier: BSD-3-Clause
"""A scene: room, noise, rates, drivers who see where the chair is; what is hidden in it, and how large."""

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from .base import BASE
from .chair import DT, Hidden, Run, coloured, drive
from .laser import LASER, Fan, Room, build, look, read
from .score import Noise, base_signals, compare, hide, laser_signals
from .strange import COVARIATES, UNKNOWN, WRONG

Array = NDArray[Any]
Pair = tuple[float, float]  # v, w
ON_LASER = ("geo", "mean", "sd", "eps", "read")
TABLES = BASE | LASER
PLAIN = [(n, "plain") for n in TABLES if n not in ("base.cross_w_to_v", "base.marker_y")]
OTHER = [(n, f) for n, line in TABLES.items() for f in line.forms if f != "plain"]
ALSO = {
    "base.marker_x": ["laser.mount_x"],
    "base.marker_y": ["laser.mount_y", "base.cross_w_to_v"],
    "base.marker_yaw": ["laser.mount_yaw"],
    "base.clock_scale": ["laser.clock_skew", "laser.latency"],
    "base.cross_w_to_v": ["base.marker_y"],
}
CONFOUNDED = [
    (only, name)
    for only, names in {
        "straight": "base.gain_v base.dac_zero_f base.curvature_v base.slope base.dead_zone_v",
        "circle": "base.understeer base.veer base.cross_v_to_w",
        "spot": "base.gain_w base.curvature_w base.left_right_gain base.dac_zero_s base.dead_zone_w",
        "": "base.cross_w_to_v base.marker_y",
    }.items()
    for name in names.split()
]
LISTS: dict[str, list[Any]] = {
    "single": PLAIN,
    "form": OTHER,
    "unknown": list(UNKNOWN),
    "confounded": CONFOUNDED,
    "wrong": list(WRONG),
}

# how long a manoeuvre lasts [s], top rates [m/s, rad/s], ramp [s], wobble of the hand
STYLES = {
    "joystick": (0.8, 3.5, 0.7, 1.0, 0.6, 0.05),
    "scripted": (1.5, 4.0, 0.6, 0.9, 0.0, 0.0),
    "slow": (2.0, 5.0, 0.3, 0.5, 0.4, 0.0),
    "busy": (0.5, 1.5, 0.8, 1.3, 0.25, 0.03),
    "careful": (1.0, 3.0, 0.45, 0.7, 0.3, 0.02),
}
MARGIN = 0.48


def _options(rng: np.random.Generator, top_v: float, top_w: float, only: str, pace: Pair) -> list[Pair]:
    """Return manoeuvres (v, w) in random order."""
    if only:
        go = {"straight": (pace[0], 0.0), "spot": (0.0, pace[1]), "circle": pace}[only]
        return [go, (0.0, 0.0)] if rng.random() < 0.8 else [(0.0, 0.0)]
    out = []
    for sort in rng.choice(6, 18, p=[0.27, 0.33, 0.12, 0.08, 0.12, 0.08]):
        v, w = top_v * rng.uniform(0.15, 1), top_w * rng.uniform(-1, 1)
        out.append([(v, 0.0), (v, w), (-0.7 * v, 0.0), (-0.6 * v, 0.6 * w), (0.0, w), (0.0, 0.0)][sort])
    return [*out, (0.0, 0.8 * top_w), (0.0, -0.8 * top_w)]


def _fits(clear: Array, room: Room, at: Array, wish: Pair, last: float) -> bool:
    (v, w), t = wish, np.arange(0.15, last + 0.9, 0.15)
    a, d = at[2] + w * t / 2, v * t * np.sinc(w * t / (2 * np.pi))
    return bool((room.clear(clear, at[0] + d * np.cos(a), at[1] + d * np.sin(a)) > MARGIN).all())


def plan(seed: list[int], s: SimpleNamespace, number: int, clear: Array, causes: list[Hidden]) -> Run:
    """Drive about in the room of scene s; the same seed does alike whatever acts."""
    rng, room, length, only = np.random.default_rng(seed), s.room, s.lengths[number], s.only
    rows, cols = np.nonzero(clear > min(MARGIN + 0.2, 0.8 * clear.max()))
    k = int(np.argmin(cols + 0.01 * np.abs(rows - rows.mean()))) if only == "straight" else int(rng.integers(len(rows)))
    head = rng.normal(0, 0.01) if only == "straight" else rng.uniform(-3.1, 3.1)
    at = np.array([room.x0 + (cols[k] + 0.5) * room.pixel, room.y0 + (rows[k] + 0.5) * room.pixel, head])
    count = round((length + 20) / DT)
    wander = np.stack([q * coloured(rng, count, s.noise.tau) for q in (s.noise.sd_v, s.noise.sd_w)], 1)
    low, high, top_v, top_w, *hand = STYLES[s.styles[number]]
    ramp, wobble = (0.0, 0.0) if only else hand
    run = Run(number, s.starts[number], at, np.zeros(1), np.zeros((1, 2)), 1.0, wander, s.columns)
    stamps, commands = [rng.uniform(0, 0.02)], [(0.0, 0.0)]
    jitter, gone = rng.uniform(0, 0.3), rng.choice([0, 0, 0.02])

    def send(wish: Pair, last: float) -> None:
        begin, old, hand = stamps[-1], np.array(commands[-1]), rng.normal(0, 1, 2)
        while stamps[-1] < begin + last:
            wait = max(0.2, 1 + jitter * rng.uniform(-1, 1)) / s.command_rate
            stamps.append(stamps[-1] + wait * (rng.integers(2, 8) if rng.random() < gone else 1))
            share = min(1.0, (stamps[-1] - begin) / ramp) if ramp else 1.0
            hand = 0.9 * hand + 0.44 * rng.normal(0, 1, 2)
            pair = (old + share * (np.array(wish) - old)) * (1 + wobble * hand * np.abs(np.sign(wish)))
            commands.append(tuple(np.round(pair, 4)))
        run.stamps, run.commands, run.length = np.round(np.array(stamps), 6), np.array(commands), float(stamps[-1])

    send((0.0, 0.0), rng.uniform(1.5, 3))
    while stamps[-1] < length - 2:
        last, blocked = rng.uniform(low, high), (0.0, 0.0 if only else float(rng.choice([-0.7, 0.7])) * top_w)
        fits = (o for o in _options(rng, top_v, top_w, only, s.pace) if _fits(clear, room, at, o, last))
        wish = next(fits, blocked)
        send(wish, last if any(wish) else min(last, rng.uniform(1.0, 2.0)))
        p = drive(run, causes)
        at = np.array([p.x[-1], p.y[-1], p.head[-1]])
    send((0.0, 0.0), 2.0)
    p = drive(run, causes)
    ahead = room.clear(clear, p.x + 0.3 * np.cos(p.head), p.y + 0.3 * np.sin(p.head))
    bad = np.flatnonzero((room.clear(clear, p.x, p.y) < 0.12) | (ahead < 0.06))
    if len(bad):
        run.length = max(8.0, bad[0] * DT - 1.0)
        keep = run.stamps < run.length
        run.stamps, run.commands = run.stamps[keep], run.commands[keep]
        drive(run, causes)
    return run


def pick(kind: str, seed: int, attempt: int) -> list[Any]:
    """Choose what to hide, in an order that comes through all of a list as the seed counts."""
    if kind in LISTS:
        mixed = np.random.default_rng(sum(map(ord, kind))).permutation(len(LISTS[kind]))
        return [LISTS[kind][mixed[(seed + 13 * (attempt // 3)) % len(mixed)]]]
    rng, names = np.random.default_rng([seed, attempt, len(kind)]), PLAIN + [p for p in PLAIN if p[0] in BASE]
    out: dict[str, str] = {}
    while len(out) < {"null": 0, "pair": 2, "triple": 3}[kind]:
        name = names[rng.integers(len(names))][0]
        if name not in ("base.steering_law", "base.clock_scale"):
            out[name] = str(rng.choice(list(TABLES[name].forms)[1:] or ["plain"])) if rng.random() < 0.2 else "plain"
    return list(out.items())


def column(rng: np.random.Generator, length: float, middle: float, swing: float, every: float) -> Any:
    """Return a smooth quantity over the time of the recording."""
    t = (np.arange(max(6, int(length / every) + 4)) - 1) * every
    spline = CubicSpline(t, middle + swing * np.clip(rng.standard_normal(len(t)), -1.8, 1.8))
    return lambda at: np.round(spline(np.clip(at, t[0], t[-1])), 3)


def settings(rng: np.random.Generator, kind: str, only: str) -> SimpleNamespace:
    """Choose room, noise, rates of one recording."""

    def log(a: float, b: float) -> float:
        return float(np.exp(rng.uniform(np.log(a), np.log(b))))

    s = SimpleNamespace(only=only, causes=[], scores=[], members=[], near=[], unknown=None, wrong=None)
    s.room = build(rng, {"straight": "hall", "circle": "hall"}.get(only, ""))
    s.noise = Noise(
        log(0.004, 0.02),
        log(0.008, 0.04),
        rng.uniform(0.1, 0.6),
        log(0.001, 0.015),
        log(0.002, 0.02),
        float(rng.choice([0, 0, rng.uniform(0.1, 0.5)])),
        rng.uniform(0.2, 1.5),
    )
    s.count = int(rng.integers(5 if only else 3, 7))
    s.test = 2 if s.count >= 5 and rng.random() < 0.5 else 1
    s.command_rate, s.pose_rate = rng.uniform(10, 50), log(5, 60)
    s.scans = bool(rng.random() < 0.88 or kind in ("wrong", "null") or only == "spot")
    beams, span = int(rng.choice([60, 90, 120, 180, 240, 341, 360])), rng.choice([np.pi, 4.1724, rng.uniform(2, 4.17)])
    step = round(float(span) / (beams - 1), 7)
    low = -2.086214 if span > 4.17 else -span / 2 + rng.uniform(-0.05, 0.05)
    s.fan = Fan(round(float(low), 6), step, beams, step / 0.006135923 * 9.765625e-5)
    lengths = [log(22, 34) if only == "straight" else log(30, 180) for _ in range(s.count)]
    s.lengths = [t * min(1.0, 700 / sum(lengths)) for t in lengths]
    s.scan_rate = max(2.0, min(rng.uniform(2, 10), log(6e4, 5e5) / beams / sum(s.lengths)))
    s.styles = [str(q) for q in rng.choice(list(STYLES), s.count)]
    s.styles = [s.styles[0]] * s.count if rng.random() < 0.4 else s.styles
    s.styles[0] = "joystick" if "slow" in s.styles and kind != "null" else s.styles[0]
    s.pace = (round(rng.uniform(0.2, 0.3), 2), round(float(rng.choice([-1, 1])) * rng.uniform(0.3, 0.6), 2))
    s.starts = [round(float(t), 3) for t in np.cumsum([0.0, *(t + rng.uniform(10, 120) for t in s.lengths)])[:-1]]
    total = s.starts[-1] + s.lengths[-1]
    s.columns = {
        "extra": column(rng, total, 0.0, 1.0, 25.0),
        "temperature": column(rng, total, 20.0, 4.0, 90.0),
        "decoy": column(rng, total, 0.0, 1.0, 40.0),
    }
    return s


def drives(s: SimpleNamespace, key: list[int], causes: list[Hidden]) -> None:
    """Drive all runs of a scene under causes, with the stamps of their scans, a little irregular."""
    clear, rng = s.room.clearance(), np.random.default_rng([*key, 77])
    s.runs = [plan([*key, k], s, k, clear, causes) for k in range(s.count)]
    counts = [max(2, int((r.length - 0.8) * s.scan_rate / 1.08)) for r in s.runs]
    s.times = [np.cumsum((1 + 0.1 * rng.uniform(-1, 1, n)) / s.scan_rate) + 0.2 for n in counts]
    s.train, s.train_times = s.runs[: s.count - s.test], s.times[: s.count - s.test]


def rough(s: SimpleNamespace, c: Hidden) -> float:
    """Return the norm of what changes the noise or the readings themselves, by the readings with and without it."""
    total, edges = 0.0, np.array([-9e9, -3, -2, -1, -0.4, 0.4, 1, 2, 3, 9e9])
    share = np.array([0.00135, 0.0214, 0.1359, 0.1859, 0.3108, 0.1859, 0.1359, 0.0214, 0.00135])
    for run, t in zip(s.train, s.train_times, strict=True):
        every = max(1, len(t) * s.fan.beams // 20000)
        g = look(s.room, s.fan, run, t[::every], [])
        a, b = (read(g, q, np.random.default_rng(run.number)) for q in ([], [c]))
        ok, both, e = np.isfinite(a) & ~g.edge, np.isfinite(a) & np.isfinite(b), g.eps
        if c.stage == "eps":
            x = max(0.0, float(((np.histogram(e[ok], edges)[0] - share * ok.sum()) ** 2 / share).sum() / ok.sum() - 8))
            for k in (1, 2, 3):
                pair = ok[:, k:] & ok[:, :-k]
                x += max(0.0, float(pair.sum() * np.mean((e[:, k:] * e[:, :-k])[pair]) ** 2 - 1))
        else:
            x = np.minimum(((a[both] - b[both]) / g.sd[both]) ** 2, 25).sum() + 9 * (np.isfinite(a) & ~both).sum()
        total += every * x
    return float(np.sqrt(total))


def scores(s: SimpleNamespace, causes: list[Hidden]) -> list[tuple[float, float, dict[str, float]]]:
    """Return for each cause z, beside, and what each rival leaves."""
    out: dict[int, tuple[float, float, dict[str, float]]] = {
        id(c): (z, 0.9 * z, {}) for c in causes if c.stage in ("eps", "read") for z in [rough(s, c)]
    }
    for base in (True, False):
        mine = [c for c in causes if id(c) not in out and (c.stage not in ON_LASER) == base]
        if mine:
            found = compare(partial(signals, s, base=base), mine, base)
            out |= {id(c): f for c, f in zip(mine, found, strict=True)}
    return [out[id(c)] for c in causes]


def signals(s: SimpleNamespace, things: list[Hidden], base: bool, fine: bool = True) -> Array:
    """Return the Gram matrix of things in the drives to fit."""
    if base:
        return base_signals(s.train, s.noise, things, 0.2 if fine else 0.4)
    return laser_signals(s.train, s.noise, s.room, s.fan, s.train_times, things, 24000 if fine else 8000)


def norm(s: SimpleNamespace, c: Hidden, size: float) -> float:
    """Return z of a cause of some size, quickly; the size stays."""
    c.size = size
    whole = c.stage in ("eps", "read")
    return rough(s, c) if whole else float(np.sqrt(signals(s, [c], c.stage not in ON_LASER, False)[0, 0]))


def fitted(s: SimpleNamespace, c: Hidden, sign: int, target: float) -> bool:
    """Give a cause the size at which z is the target, from 0.6 of the lowest to 1.5 of the highest."""
    c.size = sign * c.line.low
    if c.line.low < c.line.high:
        sizes = sign * np.geomspace(0.6 * c.line.low, 1.5 * c.line.high, 6)
        norms = np.array([max(norm(s, c, a), 1e-3) for a in sizes])
        if norms.max() < 12:
            return False
        k, target = int(np.argmax(norms >= min(target, norms.max()))), min(target, norms.max())
        share = np.clip(np.log(target / norms[k - 1]) / np.log(norms[k] / norms[k - 1]), 0, 1) if k else 0
        c.size = float(sizes[max(k - 1, 0)] * (sizes[k] / sizes[max(k - 1, 0)]) ** share)
    return True


def settled(s: SimpleNamespace, key: list[int], causes: list[Hidden], least: float) -> bool:
    """Drive with the causes, make them larger until z and beside are as promised."""
    for _ in range(5):
        drives(s, key, causes)
        if min(r.length for r in s.runs) < 15:
            return False
        s.scores, small = scores(s, causes), 1.0
        for c, (z, beside, _) in zip(causes, s.scores, strict=True):
            factor = max(10.3 / z, 1.03 * least / max(beside, 0.05), 1.0)
            small = max(small, factor)
            c.size *= min(1.1 * factor, 2.0) if factor > 1 else 1.0
            if factor > 1 and (factor > 5 or abs(c.size) > 1.6 * c.line.high):
                return False
        if small == 1.0:
            return True
    return False


def hidden(kind: str, seed: int, number: int) -> tuple[SimpleNamespace, list[int]]:
    """Return the scene with what is hidden, tried until it is large enough to be found."""
    for attempt in range(15):
        key = [number, seed, attempt]
        rng, lines = np.random.default_rng(key), pick(kind, seed, attempt)
        s = settings(rng, kind, lines[0][0] if kind == "confounded" else "")
        if kind in ("null", "wrong"):
            s.wrong = lines[0] if lines else None
            drives(s, key, [])
            return s, key
        if kind == "unknown":
            line = UNKNOWN[lines[0]]
            channel, name = line.parameter.split("/")
            s.unknown = {"channel": channel, "covariates": COVARIATES.get(name, name).split()}
            causes = [Hidden(lines[0], "unknown", line.stage, line.forms["plain"], 0.0, {}, line)]
        else:
            names = [(q[1], "plain") for q in lines] if kind == "confounded" else lines
            causes = [hide(name, form, 0.0) for name, form in names]
        s.scans = s.scans or any(c.stage in ON_LASER for c in causes)
        for c in causes:
            c.shape = {k: round(float(rng.uniform(a, b)), 3) for k, (a, b) in c.line.others.items()}
        drives(s, key, [])
        if not all(fitted(s, c, int(rng.choice(c.line.signs)), float(np.exp(rng.uniform(2.77, 4.1)))) for c in causes):
            continue
        if settled(s, key, causes, {"confounded": 0.0, "pair": 4.0, "triple": 4.0}.get(kind, 6.0)):
            s.causes = causes
            if kind == "confounded":
                rest = {n: x for n, x in s.scores[0][2].items() if n in TABLES}
                s.members = sorted({causes[0].id} | {n for n, x in rest.items() if x < 3})
                s.near = [n for n, x in rest.items() if 3 <= x < 6] + ["base.saturation"] * bool(s.only)
            if len(s.members) != 1:
                return s, key
    raise RuntimeError(f"nothing large enough for {kind} {seed}")


def parameters(c: Hidden) -> dict[str, float]:
    """Return parameters as the catalogue names them."""
    if c.id == "base.slope":
        return {"climb_x": c.size * float(np.cos(c.shape["way"])), "climb_y": c.size * float(np.sin(c.shape["way"]))}
    return {c.line.parameter: c.size, **({"inverse_w": 0.0} if c.id == "base.saturation" else {})} | {
        k: v for k, v in c.shape.items() if k != "draw"
    }


def neutral(s: SimpleNamespace) -> list[str]:
    """Return ids whose naming should not count."""
    names = {"base.process_noise", *s.near, *(n for c in s.causes for n in ALSO.get(c.id, []))}
    return sorted(names - set(s.members) - {c.id for c in s.causes})
