# SPDX-License-Identifier: BSD-3-Clause
"""A case from kind and seed: draw until it is strong enough, record, answer, write."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.scree.answers import motion_answers, range_answers
from kurumaisu.bench.strangers.scree.basics import Array, Cause, Rng
from kurumaisu.bench.strangers.scree.catalogue import told
from kurumaisu.bench.strangers.scree.kinds import (
    KINDS,
    draw_causes,
    draw_setup,
    draw_wanted,
    enough,
)
from kurumaisu.bench.strangers.scree.lasers import draw_laser
from kurumaisu.bench.strangers.scree.plant import Causes, Drive
from kurumaisu.bench.strangers.scree.ranges import Site
from kurumaisu.bench.strangers.scree.recorded import Setup, draw_drives, scan_stamps, take, withhold
from kurumaisu.bench.strangers.scree.strength import Strength
from kurumaisu.bench.strangers.scree.unknowns import NATURES
from kurumaisu.bench.strangers.scree.weighing import weigh
from kurumaisu.bench.strangers.scree.writing import Notes, write_answers, write_recording, write_truth
from kurumaisu.bench.strangers.scree.wrongs import WRONGS, Written

NEUTRAL = ("base.process_noise", "laser.dropout")


@dataclass(frozen=True)
class Case:
    """What is hidden, where, how strongly, and the drives."""

    kind: str
    setup: Setup
    causes: Causes
    found: list[Strength]
    drives: tuple[Drive, ...]
    stamps: list[Array]


def draw_case(kind: str, rng: Rng) -> Case:
    """The first of thirty draws that is strong enough: new causes every five, larger ones each time."""
    for attempt in range(30):
        if attempt % 5 == 0:
            wanted = draw_wanted(kind, rng)
            setup = draw_setup(wanted, rng)
            first = float(np.exp(rng.uniform(np.log(0.5), np.log(1.2))))
        causes = draw_causes(wanted, setup, kind, first * 1.35 ** (attempt % 5), rng)
        drives = draw_drives(setup, causes, rng)
        stamps = [scan_stamps(setup, d, rng) for d in drives]
        found = weigh(drives[:-1], stamps[:-1], causes, setup.reference, setup.site)
        if enough(kind, found):
            return Case(kind, setup, causes, found, drives, stamps)
    raise RuntimeError(f"no case of {kind} is strong enough")


def _follows(cause: Cause, setup: Setup) -> list[str]:
    columns = setup.columns
    name = columns[int(cause.draws[0] * len(columns)) % len(columns)].name
    return [name if c == "column" else c for c in NATURES[cause.id].covariates]


def _truth(case: Case, wrong: str | None) -> dict[str, object]:
    known = [(c, s) for c, s in zip(case.causes, case.found, strict=True) if c.id not in NATURES]
    unknown: dict[str, object] | None = None
    for c, s in zip(case.causes, case.found, strict=True):
        if c.id in NATURES:
            unknown = {"channel": NATURES[c.id].channel, "covariates": _follows(c, case.setup)}
            unknown |= {"z": round(s.z, 2), "beside": round(s.beside, 2)}
    causes = [
        {
            "id": c.id,
            "z": round(s.z, 2),
            "beside": round(s.beside, 2),
            "form": "other" if c.other else "usual",
            "parameters": told(c),
        }
        for c, s in known
    ]
    hidden = ", ".join(f"{c.id} {c.size:g}" for c in case.causes) or wrong or "nothing"
    laser = case.setup.site.laser.name if case.setup.site else "no laser"
    sentence = f"{case.setup.robot.name}, {laser}, {case.setup.reference.name}: {hidden}"
    return {
        "kind": case.kind,
        "causes": causes,
        "neutral": list(NEUTRAL),
        "unknown": unknown,
        "wrong": wrong,
        "sentence": sentence,
    }


def make(folder: Path, kind: str, seed: int) -> None:
    """Write a case: recording, truth.json, answers.csv."""
    if kind not in KINDS:
        raise ValueError(kind)
    rng = np.random.default_rng([zlib.crc32(b"scree"), zlib.crc32(kind.encode()), seed])
    case = draw_case(kind, rng)
    wrong = WRONGS[int(rng.integers(len(WRONGS)))] if kind == "wrong" else None
    if wrong is not None and wrong.laser and case.setup.site is None:
        site = Site(case.setup.room, draw_laser(rng))
        case = replace(case, setup=replace(case.setup, site=site))
        case = replace(case, stamps=[scan_stamps(case.setup, d, rng) for d in case.drives])
    setup, causes = case.setup, case.causes
    taken = [take(setup, causes, d, s, rng) for d, s in zip(case.drives, case.stamps, strict=True)]
    full, left = withhold(taken[-1], rng)
    answers = motion_answers(full, causes, setup.reference)
    answers += range_answers(setup, causes, replace(full, poses=left.poses), rng)
    notes = Notes(stated=float(rng.uniform(0.92, 1.12)), wrapped=wrong is None and bool(rng.random() < 0.5))
    written = Written(setup, [*taken[:-1], left], notes)
    if wrong is not None:
        written = wrong.spoil(written, rng)
    folder.mkdir(parents=True, exist_ok=True)
    laser = setup.site.laser if setup.site else draw_laser(rng)
    write_recording(folder / "recording", written.setup, written.taken, laser, written.notes)
    write_answers(folder / "answers.csv", setup.reference, full, answers)
    write_truth(folder / "truth.json", _truth(case, wrong.sentence if wrong else None))
