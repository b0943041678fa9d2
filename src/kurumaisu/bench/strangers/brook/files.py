# SPDX-License-Identifier: BSD-3-Clause
"""Writing: measured rows with their faults, the recording, the answers, the truth, and data that are wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from . import laser
from .answers import answers, follows, measure, queries
from .catalogue import UNKNOWN, on_base, parameters
from .judge import Case
from .plant import LAW_V, LAW_W, LAY, Arr, integral, volts
from .wrong import Tables, spoil

UNITS = {"t": 4, "x": 5, "y": 5, "theta": 5, "v": 4, "w": 4, "v_f": 5, "v_s": 5, "t0": 4, "t1": 4}


def tabulate(rng: np.random.Generator, c: Case, poses: list[Arr], readings: list[Arr], what: str) -> Tables:
    """The tables of each run."""
    out: Tables = []
    column = any("column" in e.ident for e in c.effects)
    hot, bumps, wrap = any(e.ident == "laser.temperature" for e in c.effects), rng.uniform() < 0.5, rng.uniform() < 0.5
    wired, second = rng.uniform() < 0.67 or "voltages" in what, rng.uniform() < 0.5
    for k, (r, m) in enumerate(zip(c.runs, c.motions, strict=True)):
        tab: dict[str, tuple[list[str], Arr]] = {"command": (["t", "v", "w"], np.stack((r.tc, r.vc, r.wc)))}
        if wired:
            tab["voltage"] = (
                ["t", "v_f", "v_s", "v", "w"],
                np.stack((r.tc, volts(r.vc, LAW_V), volts(r.wc, LAW_W), r.vc, r.wc)),
            )
        i = np.searchsorted(m.t, r.tc)
        nominal = integral(np.repeat(r.wc, np.diff(np.append(i, len(m.t)))), 0.001)
        v = np.repeat(r.vc, np.diff(np.append(i, len(m.t))))
        x, y = integral(v * np.cos(nominal), 0.001), integral(v * np.sin(nominal), 0.001)
        tab["odom"] = (["t", "x", "y", "theta", "v", "w"], np.stack((r.tc, x[i], y[i], nominal[i], r.vc, r.wc)))
        p = poses[k].copy()
        if "off" in c.faults:
            for j in rng.integers(5, p.shape[1] - 5, int(rng.integers(1, 4))):
                p[:, j] += rng.choice([-1, 1], 3) * np.array(
                    [rng.uniform(0.05, 0.4), rng.uniform(0.05, 0.4), rng.uniform(0, 0.2)]
                )
        if wrap:
            p[2] = (p[2] + np.pi) % (2 * np.pi) - np.pi
        tab["pose"] = (["t", "x", "y", "theta"], np.concatenate((c.times[k][None], p)))
        if c.scans:
            tab["scan"] = (
                ["t", *(f"r{j}" for j in range(readings[k].shape[1]))],
                np.concatenate((c.views[k].t[None], readings[k].T)),
            )
        t = np.arange(0.0, r.end, 0.2)
        rows = [t, 25.4 - 0.1 * k - 0.003 * t + 0.02 * rng.normal(size=len(t))]
        names = ["t", "battery"]
        if hot or (second and not column):
            names.append("temperature")
            rows.append(20 + np.interp(t, m.t, c.warm[k][0]) + 0.02 * rng.normal(size=len(t)))
        if column:
            names.append("tyre_pressure")
            rows.append(2.4 + 0.2 * np.interp(t, m.t, r.column[: len(m.t)]))
        if "collision" in c.faults and bumps:
            names.append("collision")
            rows.append(1.0 * ((t > r.stuck[0]) & (t < r.stuck[1])))
        tab["covariate"] = (names, np.stack(rows))
        out.append(tab)
    return out


def _cell(name: str, u: float) -> str:
    if name[0] == "r" and name[1:].isdigit():
        return f"{u:.3f}"
    return f"{u:.{UNITS.get(name, 4)}f}"


def write_tables(folder: Path, tab: dict[str, tuple[list[str], Arr]]) -> None:
    """One folder of .csv files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (cols, a) in tab.items():
        lines = [",".join(cols)] + [",".join(map(_cell, cols, row)) for row in a.T.tolist()]
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")


def write(rng: np.random.Generator, out: Path, c: Case, what: str) -> None:
    """Everything."""
    zero = [1.7e9 + float(np.round(rng.uniform(0, 1e6))) + 200.0 * k if "unix" in c.faults else 0.0 for k in range(4)]
    poses = [measure(rng, m, t, c.noise) for m, t in zip(c.motions, c.times, strict=True)]
    mine = [e for e in c.effects if not on_base(e)]
    readings = [laser.read(rng, v, mine) for v in c.views] if c.scans else []
    pairs, chosen = queries(rng, c)
    rows = answers(rng, c, poses[3], readings[3] if c.scans else np.zeros((0, 0)), pairs, chosen)
    tabs = tabulate(rng, c, poses, readings, what)
    spans = sorted(pairs + [(float(c.views[3].t[j]),) * 2 for j in chosen])
    t = tabs[3]["pose"][1][0]
    hide = np.zeros(len(t), dtype=bool)
    for a, b in spans:
        hide |= ((t > a) | (t > b - 0.3)) & (t <= b + 1e-9) if b > a else (t > b - 0.3) & (t <= b + 1e-9)
    tabs[3]["pose"] = (tabs[3]["pose"][0], tabs[3]["pose"][1][:, ~hide])
    if c.scans:
        ts = c.views[3].t
        blind = np.zeros(len(ts), dtype=bool)
        for a, b in spans:
            blind |= (ts >= a - 1e-9) & (ts <= b + 1e-9)
        tabs[3]["scan"] = (tabs[3]["scan"][0], tabs[3]["scan"][1][:, ~blind])
    tabs[3]["query"] = (["t0", "t1"], np.array(spans).T)
    if what:
        spoil(rng, c, tabs, what)
    rec = out / "recording"
    rec.mkdir(parents=True, exist_ok=True)
    for k, tab in enumerate(tabs):
        for cols, rows_of in tab.values():
            i = [j for j, n in enumerate(cols) if n in ("t", "t0", "t1")]
            rows_of[i] += zero[k] * (1000 if rows_of[0].max() > 1e4 else 1)
        write_tables(rec / f"run_{k + 1}", tab)
    meta: dict[str, Any] = {"train": ["run_1", "run_2", "run_3"], "test": ["run_4"], "world": "room.world"}
    beams = len(range(0, laser.BEAMS, c.every))
    meta["laser"] = {
        "x": LAY,
        "y": 0.0,
        "yaw": 0.0,
        "angle_min": laser.FIRST,
        "angle_increment": round(laser.INCREMENT * c.every, 9),
        "beams": beams,
    }
    if rng.uniform() < 0.67:
        meta["truth"] = {"position_sd": round(c.noise.p, 5), "heading_sd": round(c.noise.h, 5)}
    (rec / "meta.yaml").write_text(yaml.safe_dump(meta, sort_keys=False))
    (rec / "room.world").write_text(c.room.text())
    (out / "answers.csv").write_text("\n".join([rows[0]] + [_later(r, zero[3]) for r in rows[1:]]) + "\n")
    (out / "truth.json").write_text(json.dumps(truth(c, what), indent=1) + "\n")


def _later(row: str, zero: float) -> str:
    p = row.split(",")
    return ",".join([*p[:2], f"{float(p[2]) + zero:.4f}", f"{float(p[3]) + zero:.4f}", *p[4:]])


def truth(c: Case, what: str) -> dict[str, Any]:
    """truth.json."""
    causes, unknown = [], None
    for e, z, left in zip(c.effects, c.z, c.beside, strict=True):
        if e.ident in UNKNOWN:
            unknown = {"channel": UNKNOWN[e.ident][1], "covariates": follows(c, e), "z": round(z, 2)}
            continue
        given = {k: float(f"{v:.6g}") for k, v in parameters(e).items()}
        causes.append(
            {
                "id": e.ident,
                "form": "other" if e.other else "plain",
                "parameters": given,
                "z": round(z, 2),
                "beside": round(left, 2),
            }
        )
    told = (
        ", ".join(f"{e.ident}{' (other form)' if e.other else ''} of size {e.size:.4g}" for e in c.effects)
        or what
        or "nothing hidden"
    )
    end = "" if c.good else "; sizes out of the wanted range"
    note = f"brook: {told}; faults: {', '.join(sorted(c.faults)) or 'none'}{end}"
    return {
        "kind": c.kind,
        "causes": causes,
        "members": c.members,
        "unknown": unknown,
        "wrong": what or None,
        "neutral": ["base.process_noise", "base.sign", "laser.common_mode", "laser.dropout"],
        "note": note,
    }
