# SPDX-License-Identifier: BSD-3-Clause
"""Makes a case of a kind from a seed."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.loess import writing
from kurumaisu.bench.strangers.loess.answers import Answer, ask_motions, ask_scans
from kurumaisu.bench.strangers.loess.case import Case
from kurumaisu.bench.strangers.loess.drawing import DEMANDS, EFFECTS, draw_case, draw_world
from kurumaisu.bench.strangers.loess.lasers import draw_laser
from kurumaisu.bench.strangers.loess.recording import Tables, add_covariates, record
from kurumaisu.bench.strangers.loess.sensing import GEOMETRY
from kurumaisu.bench.strangers.loess.values import Truth
from kurumaisu.bench.strangers.loess.wrongs import spoil

COLUMNS = ("humidity", "pressure", "temperature")


def _parameters(truth: Truth) -> dict[str, float]:
    h = truth.hidden
    name = EFFECTS[h.id].parameter if h.id in EFFECTS else "scale"
    name = GEOMETRY[h.id][2] if h.id in GEOMETRY else name
    return {name: round(h.size, 6)} if name and not h.other else {}


def _sentence(kind: str, case: Case, found: list[Truth], wrong: str | None) -> str:
    laser = case.laser.name if case.laser is not None else "no laser"
    where = f"{case.robot.name} ({case.robot.law or 'rates'}), {laser}, {case.room.name}, {case.robot.reference.name}"
    what = ", ".join(f"{f.hidden.id} {f.hidden.size:.4g}" for f in found) or wrong or "nothing hidden"
    style = f" driven {case.style}" if case.style != "usual" else ""
    return f"{kind}: {what}; {where}{style}"


def _truth(kind: str, case: Case, found: list[Truth], wrong: str | None) -> dict[str, object]:
    causes: list[dict[str, object]] = []
    unknown: dict[str, object] | None = None
    for f in found:
        z, beside = round(f.z, 2), round(f.beside, 2)
        if kind == "unknown":
            effect = EFFECTS[f.hidden.id]
            unknown = {"channel": effect.channel, "covariates": list(effect.covariates), "z": z, "beside": beside}
        else:
            form = "other" if f.hidden.other else "usual"
            row: dict[str, object] = {"id": f.hidden.id, "z": z, "beside": beside, "form": form}
            causes.append({**row, "parameters": _parameters(f)})
    neutral = ["base.process_noise"] + (["laser.heavy_tails", "laser.dropout"] if case.laser is not None else [])
    return {
        "kind": kind,
        "causes": causes,
        "neutral": neutral,
        "unknown": unknown,
        "wrong": wrong,
        "sentence": _sentence(kind, case, found, wrong),
    }


def _columns(found: list[Truth], rng: np.random.Generator) -> list[str]:
    """The extra columns that were logged: those that matter, and perhaps others."""
    needed = {c for f in found if f.hidden.id in EFFECTS for c in EFFECTS[f.hidden.id].covariates}
    needed |= {"temperature" for f in found if f.hidden.id == "laser.temperature"}
    some = rng.random(3) < 0.3
    return [c for c, drawn in zip(COLUMNS, some, strict=True) if drawn or c in needed]


def _recorded(case: Case, found: list[Truth], rng: np.random.Generator) -> tuple[list[Tables], list[Answer]]:
    epoch = float(np.round(1.69e9 + rng.uniform(0, 6e7))) if rng.random() < 0.5 else 0.0
    names = [f"run_{i + 1}" for i in range(len(case.drives))]
    tables = [record(case, d, n, epoch, rng) for d, n in zip(case.drives, names, strict=True)]
    columns = _columns(found, rng)
    if columns:
        for t, d in zip(tables, case.drives, strict=True):
            add_covariates(t, d, columns, rng)
    answers = ask_motions(case, case.drives[-1], tables[-1], rng)
    if case.laser is not None:
        answers += ask_scans(case, case.drives[-1], tables[-1], rng)
    if rng.random() < 0.5:
        for t in tables:
            t.pose[:, 3] = (t.pose[:, 3] + np.pi) % (2 * np.pi) - np.pi
    return tables, answers


def make(folder: Path, kind: str, seed: int) -> None:
    """Write a recording of a kind, what is hidden in it, and the answers to its queries."""
    rng = np.random.default_rng([zlib.crc32(b"loess"), zlib.crc32(kind.encode()), seed])
    with np.errstate(all="ignore"):
        found: list[Truth] = []
        if kind in DEMANDS:
            case, found = draw_case(kind, rng)
        elif kind in ("null", "wrong"):
            case = draw_world([], "usual", rng)
        else:
            raise ValueError(kind)
        tables, answers = _recorded(case, found, rng)
        wrong, room = spoil(tables, case.room, case.laser is not None, rng) if kind == "wrong" else (None, case.room)
        laser = case.laser or draw_laser(rng)
        writing.write_case(folder, case, room, tables, laser)
        writing.write_truth(folder, _truth(kind, case, found, wrong), tables[-1].name, answers)
