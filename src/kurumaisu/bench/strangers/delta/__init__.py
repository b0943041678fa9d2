# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of a robot wheelchair in which something is wrong, and what."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.delta.answers import Row, answer_motion, answer_scan
from kurumaisu.bench.strangers.delta.cases import Case, choose
from kurumaisu.bench.strangers.delta.catalogue import parameters
from kurumaisu.bench.strangers.delta.core import Setup
from kurumaisu.bench.strangers.delta.files import meta, save, tables
from kurumaisu.bench.strangers.delta.room import furnish
from kurumaisu.bench.strangers.delta.wrongs import options

HEADER = ["run", "channel", "t0", "t1", "beam", "value", "base_mean", "base_sd", "oracle_mean", "oracle_sd"]


def make(out: Path, kind: str, seed: int) -> None:
    """Make one recording of a kind."""
    rng = np.random.default_rng([seed, sum(ord(c) * 31**i for i, c in enumerate(kind)) % 2**31])
    case = choose(rng, kind)
    setup = case.setup
    rows, queries = asked(case)
    drives = {d.name: tables(setup, d, queries if d is setup.drives[-1] else []) for d in setup.drives}
    said, room, sentence = meta(setup), setup.room, None
    if kind == "wrong":
        choice = options(setup)
        sentence, change, more = choice[int(rng.integers(len(choice)))]
        change(drives)
        if "laser" in more:
            said["laser"].update(more["laser"])
        if "map" in more:
            turned = [(-1.0, -1.0, np.pi), (1.25, 1.25, 0.0)][more["map"] == "scaled"]
            room = furnish(rng) if more["map"] == "other" else room
            for b in room.boxes if more["map"] != "other" else []:
                b.x, b.y, b.turn = b.x * turned[0], b.y * turned[1], b.turn + turned[2]
                b.a, b.b = b.a * abs(turned[0]), b.b * abs(turned[0])
                b.x, b.y = (b.x + setup.room.width, b.y + setup.room.depth) if turned[0] < 0 else (b.x, b.y)
    save(out / "recording", said, drives, room.world() if setup.scans else "")
    with (out / "answers.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(HEADER)
        for r in rows:
            writer.writerow([*r[:2], f"{r[2]:.5f}", f"{r[3]:.5f}", r[4], *(f"{u:.6f}" for u in r[5:])])
    (out / "truth.json").write_text(json.dumps(truth(case, kind, sentence), indent=1))


def asked(case: Case) -> tuple[list[Row], list[tuple[float, float]]]:
    """Rows of answers.csv, and the queries relative to the drive's start."""
    setup: Setup = case.setup
    drive = setup.drives[-1]
    rows: list[Row] = []
    for window in drive.windows:
        rows += answer_motion(setup, drive, case.causes, window)
    for index in drive.asked_scans:
        rows += answer_scan(setup, drive, case.causes, index)
    times = list(dict.fromkeys((r[2], r[3]) for r in rows))
    return rows, [(round(a - drive.start, 5), round(b - drive.start, 5)) for a, b in times]


def truth(case: Case, kind: str, sentence: str | None) -> dict[str, Any]:
    """What truth.json says."""
    known = [(c, z) for c, z in zip(case.causes, case.strengths, strict=True)]
    causes = [
        {"id": c.id, "z": round(z, 2), "beside": round(b, 2), "form": "other" if c.other else "same"}
        | {"parameters": parameters(c)}
        for c, (z, b) in known
        if not c.curve
    ]
    unknown = None
    for c, (z, b) in known:
        if c.curve:
            unknown = {
                "channel": c.curve.channel,
                "covariates": c.curve.accepted,
                "z": round(z, 2),
                "beside": round(b, 2),
            }
    words = "; ".join(f"{c.id} {c.size:.5g} {c.extra or ''}{' (another law)' if c.other else ''}" for c in case.causes)
    if unknown:
        words = (
            f"an unknown on {unknown['channel']} that follows {unknown['covariates']}, size {case.causes[0].size:.4g}"
        )
    if case.rivals:
        words += "; these drives cannot tell it from " + ", ".join(case.rivals)
    neutral = ["base.process_noise", *(["laser.dropout"] if case.setup.scans else [])]
    out = {"kind": kind, "causes": causes, "neutral": neutral, "unknown": unknown, "wrong": sentence}
    out["sentence"] = sentence or words or "nothing is hidden"
    if case.rivals:
        out["rivals"] = case.rivals
    return out
