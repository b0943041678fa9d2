# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of a simulated wheelchair with something hidden in each."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from .causes import KINDS, ONE_SIDED, Plan, is_base, plan, told
from .lab import Lab, Score
from .odd import UNKNOWN
from .record import record, save
from .wrong import WRONG

ATTEMPTS = 7
TOLD_APART = 2.0  # residual norm below which drives cannot tell a rival from the cause


def good(kind: str, scores: list[Score], members: list[str]) -> bool:
    """Tell whether the sizes are in the wanted range."""
    least = 4.0 if kind in ("pair", "triple") else 6.0
    most = 1e9 if kind in ("pair", "triple", "confounded") else 60.0
    if kind == "confounded":
        return len(members) > 1 and all(10 <= s.z <= most for s in scores)
    return all(10 <= s.z <= most and s.beside >= least for s in scores)


def alike(lab: Lab, rest: list[tuple[str, float, bool]]) -> list[str]:
    """What these drives cannot tell from the cause."""
    own = lab.causes[0].id
    same = {i for i, left, positive in rest if left < TOLD_APART and (positive or i not in ONE_SIDED)}
    return sorted(same | {own})


def build(rng: np.random.Generator, kind: str, todo: Plan) -> tuple[Lab, list[Score], list[str]]:
    """Drives and sizes: the sizes are found on the first drives, and again on those made with them."""
    lab = Lab(rng, todo)
    lab.go()
    if not todo.causes:
        return lab, [], []
    lab.prepare()
    lab.size(3)
    if any(is_base(c) for c in lab.causes):
        lab.go()
        lab.prepare()
        lab.size(3)
    lab.follow()
    lab.prepare()
    scores, rest = lab.scores()
    least, most = (4.6, 120.0) if kind in ("pair", "triple") else (6.9, 57.0)
    weak = [i for i, s in enumerate(scores) if s.beside < least - 0.5 and s.beside * most > least * s.z]
    if weak and kind != "confounded":  # larger, so that more is left beside the others
        for i in weak:
            todo.targets[i] = scores[i].z * least / max(scores[i].beside, 1e-3)
        lab.size(3)
        lab.follow()
        lab.prepare()
        scores, rest = lab.scores()
    return lab, scores, alike(lab, rest[0]) if kind == "confounded" else []


def make(out: Path, kind: str, seed: int) -> None:
    """Write one recording, its truth and its answers."""
    best: tuple[float, Lab, list[Score], list[str]] | None = None
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([KINDS.index(kind), seed, attempt])
        todo = plan(rng, kind, seed, attempt)
        if kind == "wrong":
            todo.scans |= WRONG[seed % len(WRONG)][2]
        lab, scores, members = build(rng, kind, todo)
        fine = good(kind, scores, members)
        worth = min([20.0, *(s.beside for s in scores)]) + 100 * fine - 50 * (lab.clear() < 0.3)
        worth -= 30 * any(s.z > 60 for s in scores)
        if best is None or worth > best[0]:
            best = (worth, lab, scores, members)
        if lab.clear() >= 0.3 and fine:
            break
    assert best is not None
    finish(out, kind, seed, best[1], best[2], best[3])


def finish(out: Path, kind: str, seed: int, lab: Lab, scores: list[Score], members: list[str]) -> None:
    """Write what was made."""
    rng = np.random.default_rng([KINDS.index(kind), seed, 99])
    made, wrong = record(lab, rng), None
    if kind == "wrong":
        wrong, fault, _ = WRONG[seed % len(WRONG)]
        if "voltages" in wrong and "voltage" not in made.runs[0]:
            wrong, fault, _ = WRONG[0]
        fault(made, rng)
    save(out, made)
    truth: dict[str, object] = {
        "kind": kind,
        "causes": [],
        "unknown": None,
        "wrong": wrong,
        "neutral": ["base.process_noise"],
    }
    text = [f"{k}" for k, on in lab.flaws.items() if on and k != "collision"] + (["collision"] if lab.crash else [])
    note = "Flaws of the files: " + (", ".join(text) or "none") + "."
    if kind == "unknown":
        assert lab.plan.unknown is not None
        channel, follows, what = lab.plan.unknown
        truth["unknown"] = {
            "channel": channel,
            "covariates": follows,
            "z": round(scores[0].z, 2),
            "beside": round(scores[0].beside, 2),
        }
        note = f"In this recording {what}. " + note
    else:
        truth["causes"] = [
            {"id": c.id, "form": c.form, "parameters": told(c), "z": round(s.z, 2), "beside": round(s.beside, 2)}
            for c, s in zip(lab.causes, scores, strict=True)
        ]
    if kind == "confounded":
        truth["members"] = members
        note = f"Drives of the mode {lab.plan.mode}. " + note
    truth["note"] = note
    (out / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


__all__ = ["KINDS", "UNKNOWN", "make"]
