# SPDX-License-Identifier: BSD-3-Clause
"""A recording's files, its truth and its answers."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .answers import Query, answer, draw_queries, withheld
from .choose import Hidden
from .drives import Run
from .hidden import parameters
from .plant import State, at, integrate, law_f, law_s
from .record import EXTRA_MEAN, EXTRA_SCATTER, Draft, clear, noisy, referred, scans_of
from .room import room_for, world_text
from .scanner import FIRST, INCREMENT, MOUNT, readings
from .values import Array, Cause
from .weigh import is_base
from .wrong import FAULTS, Files, Table

UNIX = 1.7e9


def write(out: Path, kind: str, seed: int, hidden: Hidden) -> bool:
    """Simulate with noise and write; False if the chair would have driven through a wall."""
    draft, rng = hidden.draft, hidden.draft.rng
    base = [c for c in draft.causes if is_base(c)]
    states = [_careful(draft, k, base) for k in range(4)]
    if all(map(is_base, draft.causes)):  # nothing was weighed in readings of this room
        draft.room = room_for(draft.room, np.concatenate([path[::100] for _, path in states]))
    if not all(clear(draft.room, path, 0.1) for _, path in states):
        return False
    files = Files({}, world_text(draft.room), seed)
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    voltage, rates_too = bool(rng.random() < 2 / 3) or hidden.wrong == "voltages in mV", bool(rng.random() < 0.5)
    columns, clock = _columns(hidden), UNIX if "unix" in draft.flaws else 0.0
    wrapped, told = bool(rng.random() < 0.7), bool(rng.random() < 0.5)
    queries: list[Query] = []
    for k, (run, (s, path)) in enumerate(zip(draft.runs, states, strict=True)):
        shift, rows, t = clock + run.start, referred(draft, s, path, k, base), draft.rows[k]
        tables = {"command": Table(["t", "v", "w"], np.column_stack([run.rows + shift, run.asked]))}
        if voltage:
            tables["voltage"] = _voltages(run, shift, rates_too)
        tables["odom"] = _odometry(run, shift)
        scans = np.zeros((0, 0))
        if draft.scans:
            scans = readings(scans_of(draft, k, s, path, draft.causes), draft.causes, rng, (EXTRA_MEAN, EXTRA_SCATTER))
            tables["scan"] = Table(
                ["t", *(f"r{b}" for b in range(scans.shape[1]))], np.column_stack([draft.scans[k] + shift, scans])
            )
        off, away = _off(draft, t)
        given = np.ones(len(t), bool)
        if k == 3:
            queries = draw_queries(draft, k, off)
            given = ~withheld(t, queries)
            lines += answer(draft, k, rows, scans, queries, shift)
            tables["query"] = Table(["t0", "t1"], np.array(queries) + shift)
        shown = rows + away
        if wrapped:
            shown[:, 2] = (shown[:, 2] + np.pi) % (2 * np.pi) - np.pi
        tables["pose"] = Table(["t", "x", "y", "theta"], np.column_stack([t + shift, shown])[given])
        tables["covariate"] = _covariates(run, shift, columns, "collision" in draft.flaws and told, rng)
        files.runs[run.name] = tables
    if hidden.wrong:
        FAULTS[hidden.wrong][0](files)
    _save(out, files, _meta(draft, bool(rng.random() < 1 / 3)))
    (out / "truth.json").write_text(json.dumps(_truth(kind, hidden), indent=1) + "\n")
    (out / "answers.csv").write_text("\n".join(lines) + "\n")
    return True


def _careful(draft: Draft, k: int, base: list[Cause]) -> tuple[State, Array]:
    """A drive that meets no wall, if there is one in ten: a driver looks where the chair goes."""
    out = noisy(draft, k, base)
    for _ in range(0 if all(map(is_base, draft.causes)) else 9):
        if clear(draft.room, out[1], 0.1):
            break
        out = noisy(draft, k, base)
    return out


def _columns(hidden: Hidden) -> list[str]:
    """One or two columns of covariate.csv, and what the hidden thing follows among them."""
    draft = hidden.draft
    every = list(draft.runs[0].columns)
    need = [c for c in (hidden.unknown or {}).get("covariates", []) if c in every]
    need += ["temperature"] if any(c.id == "laser.temperature" for c in draft.causes) else []
    count = int(draft.rng.integers(1, 3))
    return (need + [c for c in draft.rng.permutation(every) if c not in need])[: max(count, len(need))]


def _covariates(run: Run, shift: float, columns: list[str], collision: bool, rng: np.random.Generator) -> Table:
    t = np.arange(0.0, run.t[-1], 0.2)
    fine = {"battery": 0.01, "temperature": 0.05, "humidity": 0.01, "tyre_pressure": 0.01, "wind": 0.02}
    out = [t + shift]
    for c in columns:
        out.append(np.interp(t, run.t, run.columns[c]) + fine[c] * rng.standard_normal(len(t)))
    if collision:
        out.append(np.interp(t, run.t, run.stuck.astype(float)).round() if len(run.stuck) else 0.0 * t)
    return Table(["t", *columns, *(["collision"] if collision else [])], np.column_stack(out))


def _voltages(run: Run, shift: float, rates_too: bool) -> Table:
    v, w = run.asked.T
    rows = [run.rows + shift, law_f(v), law_s(w)] + ([v, w] if rates_too else [])
    return Table(["t", "v_f", "v_s", *(["v", "w"] if rates_too else [])], np.column_stack(rows))


def _odometry(run: Run, shift: float) -> Table:
    """Dead reckoning by the commands, as in the paper."""
    t = np.arange(0.0, run.t[-1], 0.1)
    path = at(integrate(run, run.v, run.w, 0.0 * run.v), t) - np.array([*run.pose0[:2], 0.0])
    k = np.minimum((t / 0.002).astype(int), len(run.v) - 1)
    return Table(["t", "x", "y", "theta", "v", "w"], np.column_stack([t + shift, path, run.v[k], run.w[k]]))


def _off(draft: Draft, t: Array) -> tuple[Array, Array]:
    """Single rows that are off, and by how much."""
    away = np.zeros((len(t), 3))
    if "off" not in draft.flaws:
        return np.zeros(0, int), away
    off = draft.rng.choice(len(t), max(2, len(t) // 300), replace=False)
    away[off] = (
        draft.rng.uniform(0.5, 1.5, (len(off), 3)) * draft.rng.choice([-1, 1], (len(off), 3)) * [0.15, 0.15, 0.1]
    )
    return off, away


def _meta(draft: Draft, silent: bool) -> dict[str, Any]:
    out: dict[str, Any] = {"train": ["run_1", "run_2", "run_3"], "test": ["run_4"], "world": "room.world"}
    if not silent:
        p, _, h = draft.noise.white
        out["truth"] = {"position_sd": round(float(p), 4), "heading_sd": round(float(h), 4)}
    if draft.scans:
        first, every = int(draft.beams[0]), int(draft.beams[1] - draft.beams[0])
        fan = {
            "angle_min": round(FIRST + INCREMENT * first, 9),
            "angle_increment": round(INCREMENT * every, 9),
            "beams": len(draft.beams),
        }
        out["laser"] = {"x": float(MOUNT[0]), "y": 0.0, "yaw": 0.0, **fan}
    return out


def _save(out: Path, files: Files, meta: dict[str, Any]) -> None:
    shutil.rmtree(out / "recording", ignore_errors=True)
    folder = out / "recording"
    folder.mkdir(parents=True)
    (folder / "meta.yaml").write_text(yaml.safe_dump(meta, sort_keys=False))
    (folder / "room.world").write_text(files.world)
    for name, tables in files.runs.items():
        (folder / name).mkdir()
        for part, table in tables.items():
            form = ["%.6f"] + ["%.4g" if part == "scan" else "%.6f"] * (len(table.head) - 1)
            with (folder / name / f"{part}.csv").open("w") as f:
                np.savetxt(f, table.rows, form, ",", header=",".join(table.head), comments="")


def _truth(kind: str, hidden: Hidden) -> dict[str, Any]:
    draft = hidden.draft
    causes = [
        {"id": c.id, "form": "other" if c.other else "plain", "parameters": parameters(c), "z": c.z, "beside": c.beside}
        for c in draft.causes
        if "." in c.id
    ]
    neutral = ["base.process_noise", *(["laser.common_mode", "laser.dropout"] if draft.scans else [])]
    note = hidden.note or ", ".join(f"{c.id} of size {c.size:.4g}" for c in draft.causes)
    flaws = ", ".join(sorted(draft.flaws))
    return {
        "kind": kind,
        "causes": causes,
        "members": hidden.members,
        "unknown": hidden.unknown,
        "wrong": hidden.wrong,
        "neutral": neutral,
        "note": note + (f"; the reference or the drive has: {flaws}" if flaws else ""),
    }
