# SPDX-License-Identifier: BSD-3-Clause
"""Write a recording, its truth and the answers to its queries."""

from __future__ import annotations

import json
from pathlib import Path as File
from typing import Any

import numpy as np
import yaml

from kurumaisu.bench.strangers.reed import answers
from kurumaisu.bench.strangers.reed.cases import Case, Rng, case_of, seeded
from kurumaisu.bench.strangers.reed.catalogue import parameters
from kurumaisu.bench.strangers.reed.core import Array, reference, simulate
from kurumaisu.bench.strangers.reed.laser import read, setting
from kurumaisu.bench.strangers.reed.room import furnish
from kurumaisu.bench.strangers.reed.score import Ride
from kurumaisu.bench.strangers.reed.shine import look
from kurumaisu.bench.strangers.reed.unknown import UNKNOWN, accepted
from kurumaisu.bench.strangers.reed.write import (
    Tables,
    command_table,
    covariate_table,
    measure,
    save,
    scan_table,
    spoil,
)
from kurumaisu.bench.strangers.reed.wrong import WRONG, apply
from kurumaisu.params import shipped


def _scan(rng: Rng, case: Case, ride: Ride, stamps: Array) -> Array:
    """Readings at some stamps."""
    assert case.fan is not None
    lasers = [u for u in case.uses if u.effect.stage >= 10]
    base = [u for u in case.uses if u.effect.stage < 10]
    return read(rng, look(ride, base, setting(case.fan, case.room, lasers), stamps), lasers)


def _tables(rng: Rng, case: Case, ride: Ride, electric: bool, columns: list[str]) -> tuple[Tables, Array, Array]:
    """The tables of a drive, its measured rows, and how they differ from the chair's pose: with errors, without."""
    m, path = simulate(ride.drive, case.uses, ride.pose)
    clean = reference(m, path, ride.stamps)
    rows = measure(rng, clean, ride.stamps, case.noise)
    own = np.stack(path.at(ride.stamps), axis=1)
    table = np.concatenate([ride.stamps[:, None], rows], axis=1)
    table[:, 3] = np.angle(np.exp(1j * table[:, 3]))
    tables = {**command_table(ride.drive, electric), "pose": (["t", "x", "y", "theta"], table)}
    if columns:
        tables |= covariate_table(rng, ride.drive, columns)
    if case.fan:
        tables |= scan_table(ride.scans, _scan(rng, case, ride, ride.scans))
    return tables, rows, np.concatenate([rows - own, clean - own], axis=1)


def _withhold(case: Case, tables: Tables) -> None:
    """Take out of the last drive what is asked for."""
    header, rows = tables["pose"]
    for a, b in case.spans:
        rows = rows[(rows[:, 0] <= a + 1e-6) | (rows[:, 0] > b + 1e-6)]
    tables["pose"] = (header, rows)
    both = np.concatenate([case.spans, np.stack([case.asked, case.asked], axis=1)])
    tables["query"] = (["t0", "t1"], both[np.argsort(both[:, 0])])


def _meta(rng: Rng, case: Case, names: list[str]) -> dict[str, Any]:
    """What meta.yaml says."""
    meta: dict[str, Any] = {"robot": case.how.robot, "train": names[: case.train], "test": names[case.train :]}
    if case.how.robot == "md100":
        meta["model"] = "chair.yaml"
    if case.fan:
        meta |= {"world": "room.world", "laser": dict(vars(case.fan))}
    if rng.random() < 0.3:
        meta["truth"] = {"position_sd": round(case.noise.pos, 4), "heading_sd": round(case.noise.head, 4)}
    return meta


def _truth(case: Case, kind: str, wrong: str | None) -> dict[str, Any]:
    """What truth.json says."""
    hidden = list(zip(case.uses, case.z, case.beside, strict=True))
    causes = [
        {
            "id": u.id,
            "z": round(z, 2),
            "beside": round(b, 2),
            "form": "other" if u.other else "same",
            "parameters": parameters(u),
        }
        for u, z, b in hidden
        if u.id not in UNKNOWN
    ]
    found = [
        {"channel": accepted(u)[0], "covariates": accepted(u)[1], "z": round(z, 2), "beside": round(b, 2)}
        for u, z, b in hidden
        if u.id in UNKNOWN
    ]
    told = [f"{u.id} of size {u.size:.5g}{' in another form' if u.other else ''}" for u in case.uses]
    truth = {
        "kind": kind,
        "causes": causes,
        "neutral": [
            n
            for n in ("base.process_noise", "laser.dropout")[: 1 + bool(case.fan)]
            if n not in [u.id for u in case.uses]
        ],
        "unknown": found[0] if found else None,
        "wrong": wrong,
        "sentence": wrong or "; ".join(told) or "nothing is hidden",
    }
    return truth | ({"rivals": sorted(set(case.rivals))} if kind == "confounded" else {})


def _files(out: File, case: Case, room: str) -> None:
    """The model and the map beside meta.yaml."""
    if case.how.robot == "md100":
        text = shipped("launch/md100.yaml").read_text()
        (out / "chair.yaml").write_text(text.replace("voltage_law: published", f"voltage_law: {case.how.law}", 1))
    if case.fan:
        (out / "room.world").write_text(room)


def make(out: File, kind: str, seed: int) -> None:
    """Make a recording of a kind."""
    case, attempt = case_of(kind, seed)
    rng = seeded("write", kind, seed, attempt)
    folder = out / "recording"
    folder.mkdir(parents=True, exist_ok=True)
    which = WRONG[seed % len(WRONG)] if kind == "wrong" else None
    volts = any(u.effect.stage == 1 for u in case.uses)
    electric = case.how.robot == "md100" and not which and bool(rng.random() < 0.6 or volts)
    wanted = [c for c in ("temperature", "pressure") if any(u.id.endswith(c) for u in case.uses) or rng.random() < 0.25]
    names = [f"run_{k + 1}" for k in range(len(case.rides))]
    epoch = float(1.6e9 + int(rng.integers(1 << 27)))
    drives: dict[str, Tables] = {}
    for name, ride in zip(names, case.rides, strict=True):
        drives[name], rows, errors = _tables(rng, case, ride, electric, wanted)
    ride, last = case.rides[-1], drives[names[-1]]
    told = answers.motions(rng, ride, case.uses, case.noise, rows, case.spans)
    if case.fan and len(case.asked):
        at = [int(np.argmin(np.abs(ride.stamps - t))) for t in case.asked]
        told += answers.ranges(
            rng,
            ride,
            case.uses,
            case.noise,
            (case.fan, case.room),
            case.asked,
            _scan(rng, case, ride, case.asked),
            errors[at],
        )
    _withhold(case, last)
    spared = np.concatenate([case.asked, case.spans.ravel()])
    for tables in drives.values():
        tables["pose"] = (tables["pose"][0], spoil(rng, tables["pose"][1], spared))
    if which:
        apply(which, drives)
    room = furnish(rng) if which and which[1] == "world" else case.room
    _files(folder, case, room.world("room"))
    for name, ride in zip(names, case.rides, strict=True):
        save(folder / name, drives[name], epoch + ride.drive.start)
    (folder / "meta.yaml").write_text(yaml.safe_dump(_meta(rng, case, names), sort_keys=False))
    (out / "truth.json").write_text(json.dumps(_truth(case, kind, which[0] if which else None), indent=1) + "\n")
    start = epoch + ride.drive.start
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    for row in told:
        times = [f"{float(x) + start:.6f}" for x in row[1:3]]
        lines.append(",".join([names[-1], row[0], *times, *row[3:]]))
    (out / "answers.csv").write_text("\n".join(lines) + "\n")
