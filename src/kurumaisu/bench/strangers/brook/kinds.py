# SPDX-License-Identifier: BSD-3-Clause
"""What is hidden: choosing causes, drawing their sizes until z and beside fit, and the truth about them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import laser
from .catalogue import Effect, on_base, usual
from .effects import simulate
from .judge import Case, fit_base, judge_base, judge_laser
from .plant import Arr, Noise, Run
from .rooms import drive, furnish, safe, somebody


def quiet(rng: np.random.Generator, drift: bool) -> Noise:
    """Draw the true noise."""
    p, h, k = rng.uniform(0.002, 0.008), rng.uniform(0.003, 0.01), rng.uniform(1.5, 3.0) if drift else 0.3
    return Noise(
        rng.uniform(0.006, 0.016),
        rng.uniform(0.12, 0.5),
        rng.uniform(0.012, 0.035),
        rng.uniform(0.12, 0.5),
        p,
        h,
        k * p,
        k * h,
        rng.uniform(15, 35),
        0.0,
    )


def stamps(rng: np.random.Generator, end: float, faults: set[str]) -> Arr:
    """When poses are measured."""
    hertz = float(rng.choice([10, 15, 20, 25, 30, 50, 60], p=[0.15, 0.15, 0.25, 0.15, 0.15, 0.1, 0.05]))
    gaps = rng.uniform(0.4, 1.8, int(end * hertz * 1.1)) if "uneven" in faults else np.ones(int(end * hertz))
    t = np.cumsum(gaps) / hertz
    if "bursts" in faults:
        t = np.concatenate([t, *(b + np.array([0.003, 0.006, 0.009]) for b in rng.uniform(1, end - 1, 12))])
    if "gaps" in faults:
        for b in rng.uniform(3, end - 4, 3):
            t = t[(t < b) | (t > b + rng.uniform(0.8, 1.3))]
    t = np.unique(np.round(t[t < end - 0.05], 4))
    return np.asarray(t[np.diff(t, prepend=-1.0) > 0.0015])


def drives(rng: np.random.Generator, c: Case) -> None:
    """Drive the four runs with what is hidden, so that the drivers see its effect."""
    base = [e for e in c.effects if on_base(e)]
    ram = int(rng.integers(3)) if "collision" in c.faults else -1
    c.runs = [drive(rng, c.room, c.who, base, c.noise, k == ram) for k in range(4)]
    c.times = [stamps(rng, r.end, c.faults) for r in c.runs]
    tops = {"v": max(np.abs(r.vc).max() for r in c.runs), "w": max(np.abs(r.wc).max() for r in c.runs)}
    for e in c.effects:
        e.more["top"] = float(tops["w" if e.more["axis"] else "v"])


def scan_times(rng: np.random.Generator, c: Case, run: Run) -> Arr:
    """When scans begin."""
    return np.asarray(np.round(np.arange(rng.uniform(0.05, 0.3), run.end - 0.3, 1 / c.hertz), 4))


def glance(rng: np.random.Generator, c: Case) -> None:
    """Cast all scans: as they are, and as the model expects them on the same path."""
    bent = [e for e in c.effects if not on_base(e)]
    for run, m, warm in zip(c.runs, c.motions, c.warm, strict=True):
        t = scan_times(rng, c, run)
        c.seen.append(laser.look(c.room, m, t, c.every, warm, []))
        c.views.append(laser.look(c.room, m, t, c.every, warm, bent) if bent else c.seen[-1])


def finish(c: Case) -> None:
    """The motions at 1 ms."""
    c.motions = [simulate(r, [e for e in c.effects if on_base(e)], c.noise) for r in c.runs]


def temperatures(rng: np.random.Generator, c: Case) -> None:
    """Temperature less 20 degrees, and the column, at the motions' times."""
    period, phase, swing = rng.uniform(100, 200), rng.uniform(0, 6), rng.uniform(3, 6)
    c.warm = [
        np.array([swing * np.sin(2 * np.pi * (m.t + 150 * k) / period + phase), r.column[: len(m.t)]])
        for k, (m, r) in enumerate(zip(c.motions, c.runs, strict=True))
    ]


def fresh(rng: np.random.Generator, kind: str, effects: list[Effect], faults: set[str], mode: str) -> Case:
    """A room, a driver and noise for these effects."""
    of_laser = any(not on_base(e) for e in effects)
    dark = any(e.ident == "laser.reflectance" for e in effects) or rng.uniform() < 0.2
    c = Case(
        kind,
        furnish(rng, dark),
        somebody(rng, mode),
        quiet(rng, "drift" in faults),
        effects,
        faults,
        of_laser or rng.uniform() < 0.25,
    )
    if any(e.ident in ("laser.scale", "laser.mount_y") for e in effects):  # told apart by a good reference only
        c.noise = c.noise.scaled(0.4)
    c.noise.jitter = 0.003 if "jitter" in faults else 0.0
    if any(e.ident == "base.reverse_gain" or "caster" in e.ident for e in effects):
        c.who.habits = 0.7 * c.who.habits + 0.3 * np.eye(5)[4]
    c.every, c.hertz = (
        int(rng.integers(4, 7)) if of_laser else int(rng.integers(3, 7)),
        float(rng.choice([2.0, 2.5] if of_laser else [2.0, 3.0, 4.0, 5.0])),
    )
    for e in effects:
        axis = 0 if e.ident == "unknown.haze" else int(e.more["axis"])
        e.more.update(
            boxes=float(len(c.room.boxes)),
            edge=float(c.room.boxes[0 if axis == 0 else 2, axis]) + rng.uniform(-0.6, 0.6),
        )
    return c


def compose(
    rng: np.random.Generator,
    kind: str,
    effects: list[Effect],
    faults: set[str],
    mode: str,
    least: float,
    what: str = "",
) -> Case:
    """Draw drives and sizes until what is hidden shows as it should; the best of a few."""
    low, high = (24.0, 56.0) if kind in ("pair", "triple") else (16.0, 56.0)
    targets = {e.ident: float(np.exp(rng.uniform(np.log(low if on_base(e) else 25.0), np.log(high)))) for e in effects}
    best, score = None, -1.0
    for _ in range(3 if kind == "triple" else 4):
        c = fresh(rng, kind, [replace(e, more=dict(e.more)) for e in effects], faults, mode)
        c.scans = c.scans or any(k in what for k in ("fan", "map", "ranges", "scans"))
        any_base = any(on_base(e) for e in effects)
        drives(rng, c)
        if any_base:
            fit_base(rng, c, targets, True)
        finish(c)
        temperatures(rng, c)
        if any(not on_base(e) for e in effects):
            glance(rng, c)
            judge_laser(c, targets, False)
            c.views, c.seen = [], []
        if c.scans:
            glance(rng, c)
        if any_base:
            judge_base(c)
        if any(not on_base(e) for e in effects):
            judge_laser(c, targets, True)
        clear = all(safe(c.room, m.pose) for m in c.motions)
        small = all(0.08 < abs(e.size) / usual(e) < 6 for e in c.effects)
        fits = all(10 <= z <= 60 or (kind in ("pair", "triple") and z >= 10) for z in c.z)
        shows = kind == "confounded" or not c.z or min(c.beside) >= least
        now = (
            8.0 * fits
            + 4.0 * shows
            + 2.0 * c.good * (kind == "confounded")
            + 2.0 * clear
            + 1.0 * small
            + min([*c.beside, least]) / (least + 1)
        )
        if now > score:
            best, score = c, now
        if fits and shows and c.good and clear and small:
            break
        effects = c.effects  # drive again with these sizes
        for e in effects:  # aim higher where it was hard to tell
            targets[e.ident] = min(targets[e.ident] * 1.4, 57.0) if not shows else targets[e.ident]
    assert best is not None
    best.good = bool(score >= 14.0) if kind != "confounded" else bool(score >= 15.0)
    return best
