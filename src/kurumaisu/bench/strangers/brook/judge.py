# SPDX-License-Identifier: BSD-3-Clause
"""The sizes of causes for a wanted z, and what z and beside came to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from . import laser
from .catalogue import FAR, PUSHED, RARE, SCATTER, USUAL_BASE, USUAL_LASER, Effect, on_base
from .detect import COARSE, Fit, beside, catalogue, chain, sampled
from .effects import simulate
from .plant import Arr, Motion, Noise, Run
from .rooms import Driver, Room


@dataclass
class Case:
    """All that a recording is made of."""

    kind: str
    room: Room
    who: Driver
    noise: Noise
    effects: list[Effect]
    faults: set[str]
    scans: bool
    every: int = 5
    hertz: float = 2.0
    runs: list[Run] = field(default_factory=list)
    motions: list[Motion] = field(default_factory=list)
    times: list[Arr] = field(default_factory=list)  # of rows of poses
    views: list[laser.View] = field(default_factory=list)  # what the beams meet
    seen: list[laser.View] = field(default_factory=list)  # the same, as the model thinks
    warm: list[Arr] = field(default_factory=list)  # temperature - 20 and the column, at the motions' times
    z: list[float] = field(default_factory=list)
    beside: list[float] = field(default_factory=list)
    members: list[str] = field(default_factory=list)
    good: bool = True


def _paths(c: Case) -> list[Motion]:
    base = [e for e in c.effects if on_base(e)]
    return [simulate(r, base, c.noise, COARSE) for r in c.runs[:3]]


def fit_of(c: Case) -> Fit:
    """The measures' view of the runs to fit."""
    paths = _paths(c)
    return Fit(
        c.runs[:3], paths, c.times[:3], c.noise, [chain(m, t, c.noise) for m, t in zip(paths, c.times, strict=False)]
    )


def solve(size: float, target: float, z: Callable[[float], float]) -> tuple[float, float]:
    """Scale a size until z meets the target, by secants of the logarithms."""
    power, last = 1.0, z(size)
    for _ in range(7):
        if last <= 0 or abs(np.log(target / last)) < 0.03:
            break
        k = float(np.clip((target / last) ** (1 / power), 0.2, 5.0))
        now = z(size * k)
        if now > 0 and abs(np.log(k)) > 1e-3:
            power = float(np.clip(np.log(now / last) / np.log(k), 0.4, 3.0))
        size, last = size * k, now
    return size, last


def fit_base(rng: np.random.Generator, c: Case, targets: dict[str, float], first: bool) -> None:
    """Noise level and sizes of the base causes."""
    base = [e for e in c.effects if on_base(e)]
    fit = fit_of(c)

    def z_of(e: Effect, size: float) -> float:
        return float(np.sqrt(max(fit.gram([fit.signal([replace(e, size=size)], [])])[0, 0], 0.0)))

    if first:
        ratio = np.exp(np.mean([np.log(max(z_of(e, e.size), 0.1) / targets[e.ident]) for e in base]))
        c.noise = c.noise.scaled(float(np.clip(ratio, 0.4, 2.5)))
        fit = fit_of(c)
    for e in base:
        e.size = solve(e.size, targets[e.ident], partial(z_of, e))[0]


def judge_base(c: Case) -> None:
    """Z and beside of the base causes, each given the others; members where drives are restricted."""
    base = [e for e in c.effects if on_base(e)]
    fit = fit_of(c)
    tops = {"v": max(np.abs(r.vc).max() for r in c.runs), "w": max(np.abs(r.wc).max() for r in c.runs)}
    rivals = catalogue({"top": tops}, {e.ident for e in base})
    own = [fit.signal(base, [f for f in base if f is not e]) for e in base]
    gram = fit.gram([*own, *(fit.signal([r], []) for r in rivals)])
    n = len(base)
    for k, e in enumerate(base):
        groups = {f"{r.ident}@{j}": [n + j] for j, r in enumerate(rivals)}
        groups.update({f.ident: [j] for j, f in enumerate(base) if f is not e})
        left = beside(gram, k, groups)
        c.z.append(float(np.sqrt(gram[k, k])))
        c.beside.append(min(left.values()))
        if c.kind == "confounded":
            c.members, c.good = [e.ident], True
            for name, rest in left.items():
                j = groups[name][0]
                r = rivals[j - n]
                share = gram[k, j] / max(gram[j, j], 1e-9) * r.size
                able = abs(share) < 8 * USUAL_BASE[r.ident] and (share > 0 or not any(p in r.ident for p in PUSHED))
                if rest < 2.5 and able and r.ident not in c.members:
                    c.members.append(r.ident)
                elif able and 2.5 <= rest < 4.0 and r.ident not in c.members:
                    c.good = False
            c.good = c.good and len(c.members) > 1


def _others(c: Case, mine: set[str]) -> dict[str, list[Effect]]:
    """The laser's other effects, as groups of signals."""
    out: dict[str, list[Effect]] = {}
    if "world.map_error" not in mine:
        out["world.map_error"] = [Effect("map.scale", 0.002)]
    for ident, size in USUAL_LASER.items():
        if ident in mine or ident in SCATTER or ident in RARE or ident == "world.map_error":
            continue
        e = Effect(ident, size / 2, more={"wavelength": 3.0, "phase": 0.0, "tau": 120.0, "side": 0.0})
        out[ident] = [e]
        if ident == "laser.cyclic":
            for k in (2.0, 2.5, 3.0, 3.5, 4.0):
                out[f"{ident}@{k}"] = [replace(e, more={"wavelength": k, "phase": p}) for p in (0.0, np.pi / 2)]
        elif ident == "laser.tilt":
            out.update({f"{ident}@{a}": [replace(e, more={"side": a * np.pi / 4})] for a in range(4)})
    return out


def judge_laser(c: Case, targets: dict[str, float], final: bool) -> None:
    """Sizes (or, when final, z and beside) of the laser's causes."""
    mine = [e for e in c.effects if not on_base(e)]
    keep = [(laser.mean(v.r) < FAR) & ~v.edge & (v.cos > 0.08) for v in c.seen[:3]]
    shifts = [e for e in mine if e.ident not in SCATTER and e.ident not in RARE]
    if shifts:
        _judge_shifts(c, targets, final, shifts, keep)
    for e in mine:
        if e in shifts:
            continue
        z, left = _loose(c, e, keep)
        if not final:
            e.size = solve(e.size, targets[e.ident], partial(_loose_z, c, e, keep))[0]
            continue
        c.z.append(z)
        c.beside.append(left)


def _reference(c: Case, keep: list[Any], k: int, late: bool) -> list[Arr]:
    """Signals of a marker ahead (k 0), to the left (1), or of a clock."""
    out = []
    for m, t, ok in zip(c.motions, c.times, keep, strict=False):
        d = np.array([-m.t * m.v, 0 * m.t, -m.t * m.w]) if late else np.eye(3)[k][:, None] + np.zeros((3, len(m.t)))
        out.append(np.concatenate((sampled(0.01 * d, m, t), np.zeros(int(ok.sum())))))
    return out


def _judge_shifts(c: Case, targets: dict[str, float], final: bool, shifts: list[Effect], keep: list[Any]) -> None:
    chains, cols = [], _others(c, {e.ident for e in shifts})
    for m, t, v, ok in zip(c.motions, c.times, c.seen, keep, strict=False):
        grad = np.stack([g[ok] for g in v.grad], axis=1)
        chains.append(chain(m, t, c.noise, (np.clip(v.tb[ok], 0, m.t[-1]), grad, laser.sd(v.r[ok]))))
    fit = Fit(c.runs[:3], c.motions[:3], c.times[:3], c.noise, chains)

    def signal(e: Effect) -> list[Arr]:
        return [
            np.concatenate((np.zeros(3 * len(t)), laser.shift(v, e)[ok]))
            for v, t, ok in zip(c.seen, c.times, keep, strict=False)
        ]

    def z_of(e: Effect, size: float) -> float:
        return float(np.sqrt(fit.gram([signal(replace(e, size=size))])[0, 0]))

    own = [signal(e) for e in shifts]
    if not final:
        for e in shifts:
            e.size = solve(e.size, targets[e.ident], partial(z_of, e))[0]
        return
    signals, groups = list(own), {}
    for name, parts in cols.items():
        groups[name] = [len(signals) + k for k in range(len(parts))]
        signals += [signal(p) for p in parts]
    for k, name in enumerate(("base.marker_x", "base.marker_y", "base.clock_scale")):
        groups[name] = [len(signals)]
        signals.append(_reference(c, keep, k, k == 2))
    gram = fit.gram(signals)
    for k, e in enumerate(shifts):
        both = {**groups, **{f.ident: [j] for j, f in enumerate(shifts) if f is not e}}
        c.z.append(float(np.sqrt(gram[k, k])))
        c.beside.append(min(beside(gram, k, both).values()))


def _loose_z(c: Case, e: Effect, keep: list[Any], size: float) -> float:
    return _loose(c, replace(e, size=size), keep)[0]


def _loose(c: Case, e: Effect, keep: list[Any]) -> tuple[float, float]:
    """Z and beside of a cause in the scatter, or of rare errors."""
    if e.ident in RARE:
        own = np.concatenate([laser.energy(v, e).ravel() for v in c.seen[:3]])
        more = {**e.more, "phase": 0.0}
        rivals = [[Effect(i, USUAL_LASER[i], more=more)] for i in RARE if i != e.ident]
        tables = [np.concatenate([laser.energy(v, r[0]).ravel() for v in c.seen[:3]]) for r in rivals]
        shared = max(float(own @ q) ** 2 / max(float(own @ own) * float(q @ q), 1e-12) for q in tables)
        z = float(np.sqrt(own.sum()))
        return z, z * float(np.sqrt(max(1 - shared, 0.0)))
    own = np.concatenate([laser.wider(v, e)[ok] for v, ok in zip(c.seen, keep, strict=False)])
    weight = 1.0 if e.ident == "laser.beam_correlation" else 0.5
    z = float(np.sqrt(weight * own @ own))
    if e.ident == "laser.beam_correlation":
        return z, z
    left = [z]
    for i in ("laser.range_noise", "laser.incidence_noise", "laser.quantisation"):
        if i != e.ident:
            q = np.concatenate(
                [laser.wider(v, Effect(i, USUAL_LASER[i]))[ok] for v, ok in zip(c.seen, keep, strict=False)]
            )
            left.append(float(np.sqrt(max(weight * (own @ own - (own @ q) ** 2 / (q @ q)), 0.0))))
    return z, min(left)
