# SPDX-License-Identifier: BSD-3-Clause
"""A stranger's robot wheelchair: recordings with something hidden in each."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .catalogue import BASE, LASER, MODES, ONE_FORM, RARE, SCATTER, UNKNOWN, WRONGS, Effect, effect, on_base
from .files import write
from .judge import Case
from .kinds import compose

KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")
FAULTS = ("jitter", "gaps", "bursts", "off", "drift", "uneven", "unix", "collision")


def _turn(names: tuple[str, ...], k: int, salt: int) -> str:
    """The k-th name of an order that uses all evenly."""
    return str(np.random.default_rng(salt).permutation(names)[k % len(names)])


def _chosen(rng: np.random.Generator, kind: str, seed: int) -> tuple[list[Effect], str]:
    """What is hidden, and how drives are restricted."""
    if kind in ("single", "form"):
        base, lasers = ([n for n in names if kind == "single" or n not in ONE_FORM] for names in (BASE, LASER))
        base += ["base.cross_w_to_v"] * (kind == "form")
        laser = seed % 3 == 0
        name = _turn(tuple(lasers), seed // 3, 5) if laser else _turn(tuple(base), seed - seed // 3 - 1, 6)
        return [effect(rng, name, kind == "form")], ""
    if kind in ("pair", "triple"):
        n = 2 if kind == "pair" else 3
        wanted = [_turn(BASE, seed, 7), *(_turn(BASE + LASER, n * seed + k, 8) for k in range(60))]
        names = list(dict.fromkeys(wanted))[:n]
        return [effect(rng, x) for x in names], ""
    if kind == "unknown":
        return [effect(rng, _turn(tuple(UNKNOWN), seed, 11))], ""
    if kind == "confounded":
        mode = tuple(MODES)[seed % len(MODES)]
        e = effect(rng, _turn(MODES[mode], seed // len(MODES), 12))
        e.size = -abs(e.size) if e.ident in ("base.gain_v", "base.gain_w", "base.dac_zero_f") else abs(e.size)
        return [e], mode
    return [], ""


def plan(kind: str, seed: int) -> tuple[Case, str, np.random.Generator]:
    """Compose a case: what is hidden, drives, sizes."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    effects, mode = _chosen(rng, kind, seed)
    effects.sort(key=lambda e: (not on_base(e), e.ident in SCATTER or e.ident in RARE))
    faults = {f for f in FAULTS if rng.uniform() < 1 / 6}
    what = _turn(WRONGS, seed, 13) if kind == "wrong" else ""
    c = compose(rng, kind, effects, faults, mode, 4.0 if kind in ("pair", "triple") else 6.0, what)
    return c, what, rng


def make(out: Path, kind: str, seed: int) -> None:
    """Write one recording, its truth and its answers."""
    c, what, rng = plan(kind, seed)
    write(rng, out, c, what)
