# SPDX-License-Identifier: BSD-3-Clause
"""A wheelchair of geared motors, tyres and casters, recorded with something hidden in it."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np

from .causes import BASE, CONFOUNDED, LASER, OTHER, TWINS, UNKNOWN, Cause
from .record import tables, write
from .trial import Found, Trial
from .wrong import KINDS as WRONG
from .wrong import SCANS, spoil

KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")
GOALS = {"pair": (17.0, 50.0), "triple": (18.0, 50.0)}
TIGHT = {"one_speed": (11.0, 17.0), "one_circle": (11.0, 17.0), "forward": (17.0, 35.0), "left": (20.0, 45.0)}
Plan = tuple[list[Cause], str]


def nth(causes: list[Cause], seed: int, attempt: int) -> Cause:
    """Evenly by seed: each cause once per round, in an order of that round; another one after two attempts."""
    round_, place = divmod(seed, len(causes))
    order = np.random.default_rng(1000 + round_).permutation(len(causes))
    return causes[int(order[(place + 7 * (attempt // 2)) % len(causes)])]


def plan(kind: str, seed: int, attempt: int, rng: np.random.Generator) -> Plan:
    """Causes to hide, and a style of driving for all runs ("": each its own)."""
    if kind == "single":
        return [nth(LASER, seed // 3, attempt) if seed % 3 == 0 else nth(BASE, seed - seed // 3, attempt)], ""
    if kind == "form":
        return [nth(OTHER, seed, attempt)], ""
    if kind == "unknown":
        return [nth(UNKNOWN, seed, attempt)], ""
    if kind in ("pair", "triple"):
        first = nth(BASE, seed, attempt)
        rest = [c for c in BASE + LASER if c.id != first.id]
        picked = [rest[i] for i in rng.choice(len(rest), 2, replace=False)]
        picked = [c for i, c in enumerate(picked) if c.id not in {d.id for d in picked[:i]}]
        return [first, *picked][: 2 if kind == "pair" else 3], ""
    if kind == "confounded":
        style = list(CONFOUNDED)[seed % len(CONFOUNDED)] if attempt < 2 else "wander"
        known = {c.id: c for c in BASE + TWINS}
        return [known["base." + str(rng.choice(CONFOUNDED[style]))]], style
    return [], ""


def fits(kind: str, found: list[Found]) -> bool:
    """Whether z, and what is left of it beside others, are in the wanted range."""
    if kind == "confounded":
        return all(10 <= f.z <= 80 and len(f.members) > 1 and not f.doubtful for f in found)
    if kind in ("pair", "triple"):
        return all(f.z >= 10 and f.beside >= 4 for f in found)
    return all(10 <= f.z <= 60 and f.beside >= 6 for f in found)


def badness(kind: str, found: list[Found]) -> float:
    """How far off the wanted range, to keep the least bad when nothing fits."""
    least = 4.0 if kind in ("pair", "triple") else 6.0
    return sum(max(0.0, 10 - f.z) + max(0.0, f.z - 60) + max(0.0, least - f.beside) + 5 * f.doubtful for f in found)


def truth_of(kind: str, trial: Trial, wrong: str | None) -> dict[str, Any]:
    """What truth.json says."""
    found = trial.base + trial.laser
    known = [f for f in found if f.cause.id != "unknown"]
    causes = [
        {
            "id": f.cause.id,
            "form": f.cause.form,
            "parameters": {k: round(v * f.size, 7) for k, v in f.cause.names.items()},
            "z": round(f.z, 2),
            "beside": round(f.beside, 2),
        }
        for f in known
    ]
    strange = next((f for f in found if f.cause.id == "unknown"), None)
    neutral = ["base.process_noise"] + (["laser.common_mode", "laser.dropout"] if trial.scanned else [])
    unknown = strange and {
        "channel": strange.cause.channel,
        "covariates": list(strange.cause.follows),
        "z": round(strange.z, 2),
    }
    note = "; ".join(f"{f.cause.why} ({', '.join(f'{k}={v:.5g}' for k, v in f.fault().items())})" for f in found)
    return {
        "kind": kind,
        "causes": causes,
        "members": list(found[0].members) if kind == "confounded" else [],
        "unknown": unknown,
        "wrong": wrong,
        "neutral": neutral,
        "note": note or wrong or "a sound chair",
    }


def make(out: Path, kind: str, seed: int) -> None:
    """Write one recording with its truth and answers."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    best: Trial | None = None
    wrong = WRONG[seed % len(WRONG)] if kind == "wrong" else None
    least = {"pair": 4.0, "triple": 4.0, "confounded": 0.0}.get(kind, 6.0)
    for attempt in range(6):
        causes, style = plan(kind, seed, attempt, rng)
        scans = any(c.laser for c in causes) or wrong in SCANS or bool(rng.random() < 0.25)
        trial = Trial(rng, causes, style, GOALS.get(kind, TIGHT.get(style, (15.0, 45.0))), scans, least)
        found = trial.base + trial.laser
        if best is None or badness(kind, found) < badness(kind, best.base + best.laser):
            best = trial
        if fits(kind, found):
            best = trial
            break
    assert best is not None
    names = ["battery", "temperature", "pressure"]
    need = {"laser.temperature": "temperature", "laser.warmup": "temperature", "base.battery_sag": "battery"}
    best.logged = {need[f.cause.id] for f in best.base + best.laser if f.cause.id in need}
    if "pressure" in best.full:
        best.logged.add("pressure")
    best.logged |= {str(rng.choice([n for n in names if n not in best.logged]))}
    best.log_hit = bool(rng.random() < 0.5)
    recording = tables(best, rng)
    if wrong:
        if wrong == "voltages in mV" and "voltage" not in recording.runs[0]:
            wrong = "positions in mm"
        spoil(wrong, recording, rng)
    write(out, recording, truth_of(kind, best, wrong))
