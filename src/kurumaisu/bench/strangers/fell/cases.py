# SPDX-License-Identifier: BSD-3-Clause
"""Draw a case of some kind, see whether it shows, and write it."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.fell.catalogue import CONFOUNDED, IDS, VOLTS, draw, draw_unknown
from kurumaisu.bench.strangers.fell.files import write
from kurumaisu.bench.strangers.fell.judge import Judge
from kurumaisu.bench.strangers.fell.plant import Cause, Rng
from kurumaisu.bench.strangers.fell.scene import Scene, stage

WRONG = (
    *("poses in mm", "degrees", "y mirrored", "swapped axes", "clockwise headings", "stamps in ms", "speed reversed"),
    *("a clock seconds off", "poses of another drive", "a drive given twice"),
    *("ranges in mm", "mirrored map", "mirrored fan", "another map"),  # of scans
)
PLAIN = ("base.steering_law", "base.sign", "laser.saturation", "laser.mixed_pixels")  # have one equation, or are huge
COUNT = {"null": 0, "wrong": 0, "unknown": 0, "pair": 2, "triple": 3}
BAR = {"pair": 4, "triple": 4, "unknown": 0, "confounded": 0}
WHERE = {"speed": " in drives of one speed only", "left": " in drives of left turns only", "": ""}


def _choose(lead: Rng, kind: str) -> tuple[list[str], str]:
    """Return ids to hide, and how drives are limited."""
    pool = [i for i in IDS if kind != "form" or i not in PLAIN]
    ids = [str(i) for i in lead.choice(pool, COUNT.get(kind, 1), replace=False)]
    if kind != "confounded":
        return ids, ""
    i, limit = CONFOUNDED[int(lead.integers(len(CONFOUNDED)))]
    return [i], limit


def _truth(sc: Scene, kind: str, score: list[tuple[float, float]], limit: str, wrong: str) -> dict[str, Any]:
    """Return truth.json."""
    told: list[dict[str, Any]] = []
    unknown, follows = None, ""
    for c, (z, b) in zip(sc.causes, score, strict=True):
        sure = {"z": round(z, 1), "beside": round(b, 1)}
        if kind == "unknown":
            unknown = {"channel": c.id.removeprefix("unknown."), "covariates": [c.p["of"]], **sure}
            follows = f" follows {c.p['of']}"
        else:
            parameters = {k: round(float(c.p[k]), 6) for k in c.told}
            told.append({"id": c.id, **sure, "form": "other" if c.other else "usual", "parameters": parameters})
    ids = [c.id for c in sc.causes]
    what = wrong or ", ".join(ids) + follows or "nothing"
    return {
        "kind": kind,
        "causes": told,
        "neutral": [i for i in ("base.process_noise", "laser.heavy_tails") if i not in ids],
        "unknown": unknown,
        "wrong": wrong or None,
        "sentence": f"{sc.robot.kind}, {sc.ref.name}, {sc.las.name if sc.las else 'no laser'}: {what}{WHERE[limit]}",
    }


def _grown(size: float, score: list[tuple[float, float]], bar: float) -> float:
    """Return the size to try after one that was too weak."""
    low = min(min(z / 10, b / max(bar, 1) if z >= 10 and bar else 9) for z, b in score)
    return size * float(np.clip(1.15 / max(low, 0.05), 1.35, 2.5))


def make(folder: Path, kind: str, seed: int) -> None:
    """Write a case of a kind into a folder, or raise RuntimeError where none is strong enough."""
    key = [zlib.crc32(kind.encode()), seed]
    lead, bar = np.random.default_rng(key), BAR.get(kind, 6)
    wrong = WRONG[int(lead.integers(len(WRONG)))] if kind == "wrong" else ""
    for attempt in range(30):
        if attempt % 5 == 0:
            (ids, limit), size = _choose(lead, kind), 1.0
            sub = int(lead.integers(1 << 30))
        rng, own = np.random.default_rng([*key, attempt]), np.random.default_rng(sub)
        causes: list[Cause] = [draw(i, own, size, other=kind == "form") for i in ids]
        if kind == "unknown":
            causes = [draw_unknown(own, size)]
        scans = any(not c.id.startswith(("base.", "unknown.base.")) for c in causes) or wrong in WRONG[-4:]
        try:
            sc = stage(rng, causes, any(i in VOLTS for i in ids), scans, limit)
        except RuntimeError:
            continue
        score = Judge(sc).score() if causes else []
        if all(z >= 10 and b >= bar for z, b in score):
            write(folder, rng, sc, _truth(sc, kind, score, limit, wrong), wrong)
            return
        size = _grown(size, score, bar)
    raise RuntimeError(f"{kind} {seed}: no case that is strong enough")
