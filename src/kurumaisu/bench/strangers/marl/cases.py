# SPDX-License-Identifier: BSD-3-Clause
"""Cases: a robot in a room with something hidden, drawn until it is strong enough."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.marl.causes import Cause, draw_causes, rivals, settle
from kurumaisu.bench.strangers.marl.driving import Drive
from kurumaisu.bench.strangers.marl.score import Score, Shown
from kurumaisu.bench.strangers.marl.setting import Case, Setting
from kurumaisu.bench.strangers.marl.things import Rng
from kurumaisu.bench.strangers.marl.writing import write

NEED = 10  # how sure a cause is to be
BESIDE = {"single": 6, "form": 6, "pair": 4, "triple": 4, "unknown": 0, "confounded": 0}


def _enough(kind: str, shown: list[Shown]) -> bool:
    z, beside = min(z for z, _ in shown), min(b for _, b in shown)
    if kind == "confounded":
        return z >= NEED and beside < max(4, 0.3 * z)
    return z >= NEED and beside >= BESIDE[kind]


def _grow(kind: str, causes: list[Cause], shown: list[Shown]) -> None:
    """Make causes 1.35 times as large that do not show enough."""
    for c, (z, beside) in zip(causes, shown, strict=True):
        if z < NEED * 1.05 or beside < BESIDE[kind] * 1.05:
            c.size = float(np.sign(c.size) * min(abs(c.size) * 1.35, c.top))


def _strong(rng: Rng, kind: str, causes: list[Cause], s: Setting) -> tuple[list[Drive], list[Shown]] | None:
    """Return drives in which causes of a sufficient size show; None where there are none."""
    others = rivals(rng, s.robot.chair, s.room, s.laser)
    plain = s.drives(rng, [], 2)
    if plain is None:
        return None
    for _ in range(5):
        for c in causes:
            settle(c, s.room, s.laser)
        shown = Score(plain, s.room, s.ref, causes).judge(others)
        if _enough(kind, shown):
            break
        _grow(kind, causes, shown)
    else:
        return None
    drives = s.drives(rng, causes)
    if drives is None:
        return None
    shown = Score(drives[:-1], s.room, s.ref, causes).judge(others)
    return (drives, shown) if _enough(kind, shown) else None


def _case(rng: Rng, kind: str) -> Case:
    for _ in range(7):
        causes, limit = draw_causes(rng, kind)
        setting = Setting(rng, causes, limit, kind)
        if causes:
            if found := _strong(rng, kind, causes, setting):
                return Case(kind, setting, causes, *found)
        else:
            drives = setting.drives(rng, [])
            if drives and len(drives[-1].tp) > 300:
                return Case(kind, setting, causes, drives, [])
    raise RuntimeError(f"{kind}: no draw was strong enough")


def make(folder: Path, kind: str, seed: int) -> None:
    """Write folder/recording, truth.json and answers.csv of a case of this kind."""
    rng = np.random.default_rng([zlib.crc32(b"marl"), zlib.crc32(kind.encode()), seed])
    case = _case(rng, kind)
    write(folder, rng, case)
