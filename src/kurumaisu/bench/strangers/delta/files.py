# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a recording, and how they are written."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from kurumaisu.bench.strangers.delta.core import Array, Drive, Setup
from kurumaisu.bench.strangers.delta.law import volts

Tables = dict[str, tuple[list[str], Array]]
DIGITS = {"x": 5, "y": 5, "theta": 6, "v": 4, "w": 4, "v_f": 5, "v_s": 5}


def tables(setup: Setup, drive: Drive, rows: list[tuple[float, float]]) -> Tables:
    """Tables of a drive; `rows` are the queries (t0, t1), relative to its start."""
    t, v, w = drive.commands.T
    out: Tables = {}
    start = drive.start
    if setup.volts:
        out["voltage"] = (["t", "v_f", "v_s", "v", "w"], np.stack([start + t, *volts(v, w), v, w], -1))
    else:
        out["command"] = (["t", "v", "w"], np.stack([start + t, v, w], -1))
    hidden = np.zeros(len(drive.rows), dtype=bool)
    for t0, t1 in rows:
        hidden |= (drive.rows > t0 + 1e-6) & (drive.rows <= t1 + 1e-6)
    pose = drive.poses[~hidden].copy()
    if setup.facts["wrapped"]:
        pose[:, 2] = np.arctan2(np.sin(pose[:, 2]), np.cos(pose[:, 2]))
    out["pose"] = (["t", "x", "y", "theta"], np.column_stack([start + drive.rows[~hidden], pose]))
    if setup.scans:
        left = np.setdiff1d(np.arange(len(drive.scan_t)), drive.asked_scans)
        names = ["t", *(f"r{i}" for i in range(setup.fan.beams))]
        out["scan"] = (names, np.column_stack([start + drive.scan_t[left], drive.scans[left]]))
    if setup.columns:
        s = np.arange(0.0, drive.length, 2.0)
        values = [np.round(f(drive.session + s), 3) for f in setup.columns.values()]
        out["covariate"] = (["t", *setup.columns], np.column_stack([start + s, *values]))
    if rows:
        out["query"] = (["t0", "t1"], start + np.array(rows))
    return out


def meta(setup: Setup) -> dict[str, Any]:
    """What meta.yaml says."""
    names, fan = [d.name for d in setup.drives], setup.fan
    out: dict[str, Any] = {"train": names[: setup.train], "test": names[setup.train :]}
    if not setup.volts:
        out["robot"] = "velocity"
    if setup.facts["says_truth"]:
        out["truth"] = {"position_sd": round(setup.noise.position, 5), "heading_sd": round(setup.noise.heading, 5)}
    if setup.scans:
        out["world"] = "room.world"
        where = {"x": fan.x, "y": 0.0, "yaw": 0.0, "angle_min": round(fan.angle_min, 7)}
        out["laser"] = {**where, "angle_increment": fan.increment, "beams": fan.beams}
        out["laser"]["time_increment"] = fan.time_increment
    return out


def save(folder: Path, said: dict[str, Any], drives: dict[str, Tables], world: str) -> None:
    """Write a recording."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "meta.yaml").write_text(yaml.safe_dump(said, sort_keys=False))
    if world:
        (folder / "room.world").write_text(world)
    for name, parts in drives.items():
        (folder / name).mkdir(exist_ok=True)
        for part, (header, data) in parts.items():
            forms = ["%.5f" if h in ("t", "t0", "t1") else f"%.{DIGITS.get(h, 3)}f" for h in header]
            np.savetxt(folder / name / f"{part}.csv", data, forms, ",", header=",".join(header), comments="")
