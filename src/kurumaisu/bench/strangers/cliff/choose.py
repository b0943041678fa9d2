# SPDX-License-Identifier: BSD-3-Clause
"""What is hidden in a recording of a kind, and how large it must be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .hidden import FORMS, LASER, PLAIN, READ, REFERENCE, UNKNOWN, draw_cause, draw_unknown, tops
from .record import Draft, draw
from .values import Array, Cause, Rng
from .weigh import BaseScale, LaserScale, beside, is_base, is_scatter
from .wrong import FAULTS


@dataclass
class Hidden:
    """A recording and what its truth.json says."""

    draft: Draft
    members: list[str] = field(default_factory=list)
    unknown: dict[str, Any] | None = None
    wrong: str | None = None
    note: str = ""


@dataclass(frozen=True)
class Wanted:
    """Range of z, and the least beside."""

    low: float
    high: float
    beside: float


def _cap(c: Cause) -> float:
    """The largest size that is still a machine."""
    start = abs({**UNKNOWN, **REFERENCE, **READ}[c.id][1]) if "." not in c.id else abs(c.size)
    name = c.id.split(".")[-1]
    most = {"saturation": 0.55, "packets": 1.0, "warm": 0.5, "slack": 0.5, "flat": 0.3, "beam_correlation": 0.6}
    return most.get(name, 12.0 * start)


def _tune(causes: list[Cause], weigh: Any, groups: dict[str, list[int]], want: Wanted, rng: Rng) -> bool:
    """Scale sizes until every z and beside is in its range."""
    caps, target = [_cap(c) for c in causes], np.zeros(len(causes))
    for turn in range(5):
        gram = weigh(causes)
        z = np.sqrt(np.diag(gram)[: len(causes)])

        least = np.array([min(left.values()) for left in beside(gram, causes, groups, len(causes))])
        if (z < 1e-3).any():
            return False
        if turn == 0:
            need = np.maximum(1.15 * want.low, 1.15 * want.beside * z / np.maximum(least, 1e-6))
            if (need > 0.92 * want.high).any():
                return False
            target = np.exp(rng.uniform(np.log(need), np.log(np.maximum(0.9 * want.high, need))))
        fits = (z >= want.low) & (z <= want.high) & (least >= want.beside)
        if turn and fits.all():
            for c, a, b in zip(causes, z, least, strict=True):
                c.z, c.beside = round(float(a), 2), round(float(b), 2)
            return True
        for c, a, goal, cap in zip(causes, z, target, caps, strict=True):
            c.size *= float(np.clip(goal / a, 0.1, 10.0))
            if abs(c.size) > cap:
                return False
    return False


def _size(draft: Draft, causes: list[Cause], want: Wanted, rng: Rng) -> bool:
    """Sizes for all: base, then the laser's mean, then its scatter."""
    base = BaseScale(draft) if any(map(is_base, causes)) or draft.scans else None
    mine = [c for c in causes if is_base(c)]
    if mine:
        assert base is not None
        if not _tune(mine, lambda cs: base.measure(cs, mine), base.groups, want, rng):
            return False
    rest = [c for c in causes if not is_base(c)]
    if not rest:
        return True
    assert base is not None
    laser = LaserScale(draft, base.pose_var, mine)
    mean, spread = [c for c in rest if not is_scatter(c)], [c for c in rest if is_scatter(c)]
    if mean and not _tune(mean, laser.measure, laser.groups, want, rng):
        return False
    if spread:
        groups = laser.scatter(spread)[1]
        return _tune(spread, lambda cs: laser.scatter(cs)[0], groups, want, rng)
    return True


def _names(kind: str, seed: int, turn: int, rng: Rng) -> list[tuple[str, bool]]:
    """Ids and whether in another form: evenly by seed, another one after two vain attempts."""
    fixed = np.random.default_rng(7)
    mixed = {k: list(fixed.permutation(v)) for k, v in (("base", PLAIN), ("laser", LASER), ("form", FORMS))}
    at = seed + turn // 2
    if kind == "single":
        if seed % 3 == 0:
            return [(str(mixed["laser"][(seed // 3 + turn // 2) % len(LASER)]), False)]
        return [(str(mixed["base"][(at - 1 - seed // 3) % len(PLAIN)]), False)]
    if kind == "form":
        return [(str(mixed["form"][at % len(FORMS)]), True)]
    n = 2 if kind == "pair" else 3
    out: set[str] = {str(mixed["laser" if at % 2 else "base"][(seed // 2 + turn // 2) % 20])}
    while len(out) < n:
        out.add(str(rng.choice(LASER if rng.random() < 1 / 3 else PLAIN)))
    return [(name, False) for name in sorted(out)]


def _plain(kind: str, seed: int, turn: int, rng: Rng) -> Hidden | None:
    names = _names(kind, seed, turn, rng)
    laser = any(not n.startswith("base.") for n, _ in names) or seed % 4 == 0
    draft = draw(rng, laser, any(n == "laser.reflectance" for n, _ in names) or rng.random() < 0.5)
    top = tops(draft.runs[:3])
    draft.causes = [draw_cause(n, other, top, rng) for n, other in names]
    want = Wanted(10.0, 60.0, 6.0) if len(names) == 1 else Wanted(10.0, 80.0, 4.0)
    return Hidden(draft) if _size(draft, draft.causes, want, rng) else None


def _unknown(seed: int, turn: int, rng: Rng) -> Hidden | None:
    every = {**UNKNOWN, **REFERENCE, **READ}
    order = list(np.random.default_rng(9).permutation(list(every)))
    name = str(order[(seed + turn // 2) % len(order)])
    draft = draw(rng, name in READ or seed % 4 == 0, False)
    c = draw_unknown(name, rng)
    draft.causes = [c]
    if not _size(draft, [c], Wanted(10.0, 60.0, 6.0), rng):
        return None
    told = {"channel": every[name][2], "covariates": every[name][3], "z": c.z, "beside": c.beside}
    return Hidden(draft, unknown=told, note=f"{name}: in no line of the catalogue, size {c.size:.4g}")


def _confounded(seed: int, turn: int, rng: Rng) -> Hidden | None:
    """Restricted drives, and of what they can show one cause that others can stand for."""
    modes = ["speed", "left", "arc", "forward", "spin", "straight"]
    draft = draw(rng, seed % 4 == 0, False, modes[(seed + turn) % len(modes)])
    scale = BaseScale(draft)
    gram = scale.catalogue.T @ scale.catalogue
    found: list[tuple[str, float, list[str]]] = []
    for name, group in scale.groups.items():
        i, z = group[0], float(np.sqrt(gram[group[0], group[0]]))
        target = float(rng.uniform(14.0, 35.0))
        if z < 0.5 or len(group) > 1:
            continue
        left = beside_all(gram, i, scale.groups, name, target / z)
        members = [n for n, a in left.items() if a < 2.0]
        if 1 <= len(members) <= 3 and not any(2.0 <= a < 4.5 for a in left.values()):
            found.append((name, target / z, members))
    for k in rng.permutation(len(found)):
        name, factor, _ = found[int(k)]
        c = draw_cause(name, False, tops(draft.runs[:3]), rng)
        c.size *= factor
        if abs(factor) > 12.0:
            continue
        gram = scale.measure([c], [c])
        left = beside_all(gram, 0, {n: [1 + j for j in g] for n, g in scale.groups.items()}, name, 1.0)
        members = sorted([name, *(n for n, a in left.items() if a < 2.5)])
        c.z, c.beside = round(float(np.sqrt(gram[0, 0])), 2), round(min(left.values()), 2)
        if c.z >= 10.0 and 2 <= len(members) <= 4:
            draft.causes = [c]
            return Hidden(draft, members=members, note="drives restricted so that the members act alike")
    return None


def beside_all(gram: Array, i: int, groups: dict[str, list[int]], name: str, factor: float) -> dict[str, float]:
    """What each other effect that shows in these drives leaves of a signal."""
    from .whiten import left_beside

    shown = {n: [j for j in g if gram[j, j] > 0.04] for n, g in groups.items() if n != name}
    return {n: factor * left_beside(gram, i, g) for n, g in shown.items() if g}


def choose(kind: str, seed: int, turn: int, rng: Rng) -> Hidden | None:
    """An attempt at a recording of that kind; None if the drives do not show it well."""
    if kind == "unknown":
        return _unknown(seed, turn, rng)
    if kind == "confounded":
        return _confounded(seed, turn, rng)
    if kind == "null":
        return Hidden(draw(rng, seed % 4 == 0, bool(rng.random() < 0.5)), note="nothing is hidden")
    if kind == "wrong":
        names = list(FAULTS)
        name = names[seed % len(names)]
        return Hidden(draw(rng, FAULTS[name][1] or seed % 4 == 0, False), wrong=name, note="the data are wrong")
    return _plain(kind, seed, turn, rng)
