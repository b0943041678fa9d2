# SPDX-License-Identifier: BSD-3-Clause
"""Writes a case: tables as they come from real recorders, the truth, and the answers."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.holm.answers import motions, scans
from kurumaisu.bench.strangers.holm.core import PUBLISHED, TRANSLATION, Array, Effect, relative, wrap
from kurumaisu.bench.strangers.holm.drives import Drive, Scene, measure, stamped, true_time
from kurumaisu.bench.strangers.holm.laser import look, read
from kurumaisu.bench.strangers.holm.rooms import draw
from kurumaisu.params import shipped

Rng = np.random.Generator
MODEL = shipped("launch/md100.yaml")


@dataclass
class Case:
    """Everything that happened."""

    drives: list[Drive]
    effects: list[Effect]
    scene: Scene
    zero: float
    voltages: bool
    decoys: list[str]
    dead: Array
    tamper: str
    says: bool


def _table(path: Path, names: Sequence[str], rows: Array, digits: Sequence[int]) -> None:
    lines = [",".join(f"{x:.{n}f}" for n, x in zip(digits, row, strict=True)) for row in rows.tolist()]
    path.write_text("\n".join([",".join(names), *lines]) + "\n")


def _reference_times(rng: Rng, c: Case, d: Drive) -> Array:
    t = np.arange(0.05, d.duration - 0.05, 1 / c.scene.ref.rate)
    t = t + rng.uniform(-0.25, 0.25, t.size) / c.scene.ref.rate * rng.random()
    keep = np.ones(t.size, dtype=bool)
    for _ in range(int(rng.integers(0, 4))):
        at = rng.uniform(5, d.duration - 5)
        keep &= np.abs(t - at) > rng.uniform(0.1, 0.7)
    if rng.random() < 0.3:
        at, long = rng.uniform(0, d.duration * 0.6), rng.uniform(5, 20)
        keep &= ~((t > at) & (t < at + long) & (np.arange(t.size) // 3 % 3 == 1))
    return np.asarray(t[keep])


def _off(rng: Rng, poses: Array, spare: set[int]) -> None:
    for i in rng.integers(10, len(poses) - 10, int(rng.integers(0, 5))).tolist():
        if i not in spare:
            poses[i, :2] += rng.uniform(0.05, 0.4) * np.array([np.cos(i), np.sin(i)])


def _poses(rng: Rng, c: Case, d: Drive, needed: Array) -> tuple[Array, Array]:
    t = np.concatenate([_reference_times(rng, c, d), true_time(needed, d.start, c.effects)])
    t = np.sort(np.unique(np.round(t, 5)))
    stamps = np.round(stamped(t, d.start, c.effects), 4)
    return stamps, measure(rng, c.scene.ref, d, true_time(stamps, d.start, c.effects), c.effects)


def _motion_queries(rng: Rng, d: Drive, stamps: Array, count: int) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    for _ in range(count * 30):
        i = int(rng.integers(20, stamps.size - 5))
        j = int(np.searchsorted(stamps, stamps[i] + rng.uniform(1.6, 2.4)))
        if j < stamps.size - 1 and 1.4 < stamps[j] - stamps[i] < 2.8 and stamps[j] < d.duration - 0.5:
            way = d.motion.at(np.array([stamps[i], stamps[j]]))
            if np.abs(way[1] - way[0]).max() > 0.05 or rng.random() < 0.1:
                found.append((i, j))
        if len(found) == count:
            break
    return sorted(found)


def _commands(folder: Path, c: Case, d: Drive, zero: float, rng: Rng) -> None:
    t, law = d.commands.t + zero, c.scene.law
    v = d.commands.v * {"commands in km/h": 3.6, "speed of the wrong sign": -1}.get(c.tamper, 1)
    w = d.commands.w * (-1 if c.tamper == "yaw rate of the wrong sign" else 1)
    if c.voltages:
        volts = np.round([TRANSLATION.volts(v), law.volts(w)], 5) * (1000 if c.tamper == "voltages in mV" else 1)
        names, columns = ["t", "v_f", "v_s"], [t, *volts]
        if law is PUBLISHED or rng.random() < 0.5:
            names, columns = [*names, "v", "w"], [*columns, v, w]
        _table(folder / "voltage.csv", names, np.stack(columns, axis=1), [4, 5, 5, 5, 5][: len(names)])
    if not c.voltages or rng.random() < 0.3:
        _table(folder / "command.csv", ["t", "v", "w"], np.stack([t, v, w], axis=1), [4, 5, 5])


def _twist(tamper: str, t: Array, poses: Array) -> tuple[Array, Array]:
    p = poses.copy()
    if tamper == "positions in mm":
        p[:, :2] *= 1000
    elif tamper == "headings in degrees":
        p[:, 2] = np.degrees(wrap(p[:, 2]))
    elif tamper == "y of the wrong sign":
        p[:, 1] *= -1
    elif tamper == "x and y swapped":
        p[:, :2] = p[:, 1::-1]
    elif tamper == "heading clockwise":
        p[:, 2] *= -1
    elif tamper == "heading of a compass":
        p[:, 2] = np.pi / 2 - p[:, 2]
    elif tamper == "clock of the reference is shifted":
        t = t + 3.7
    elif tamper == "times of the reference in ms":
        t = t * 1000
    return t, p


def _readings(c: Case, d: Drive, rng: Rng) -> tuple[Array, Array]:
    """All readings of a drive, and the numbers of the scans to predict."""
    asked = np.zeros(0, dtype=int)
    if c.scene.room is None or c.scene.fan is None:
        return np.zeros((0, 0)), asked
    made = look(c.scene.room, d.motion.at, d.stamps, c.scene.fan, c.effects, start=d.start, extra=d.extra)
    got = read(made, c.effects, rng)
    got[:, c.dead] = np.nan
    if d.test:
        good = [i for i in range(3, d.stamps.size - 3) if np.isfinite(got[i]).sum() > 20]
        if good:
            asked = np.sort(rng.choice(good, min(int(rng.integers(6, 11)), len(good)), replace=False))
        asked = asked[np.diff(asked, prepend=-9) > 1]
    return got, asked


def _meta(c: Case, out: Path, rng: Rng) -> None:
    """The model, the world, and meta.yaml."""
    scene, f = c.scene, c.scene.fan
    text = MODEL.read_text()
    if scene.law is not PUBLISHED:
        text = text.replace("voltage_law: published ", "voltage_law: corrected ", 1)
    (out / "md100.yaml").write_text(text)
    meta = ["model: md100.yaml"]
    if f and scene.room:
        shown = draw(np.random.default_rng(int(rng.integers(1 << 30)))) if c.tamper == "another map" else scene.room
        (out / "room.world").write_text(shown.world())
        meta += [
            "world: room.world",
            f"laser: {{x: {f.x}, y: {f.y}, yaw: {f.yaw}, angle_min: {f.angle_min:.7f}, angle_increment: "
            f"{f.angle_increment:.9f}, beams: {f.beams}, time_increment: {f.time_increment:.8e}}}",
        ]
    if c.says:
        place = np.hypot(scene.ref.sd, scene.ref.wander)
        meta.append(f"truth: {{position_sd: {place:.5f}, heading_sd: {scene.ref.sd_th:.5f}}}")
    for part in ("train", "test"):
        meta.append(f"{part}: [" + ", ".join(d.name for d in c.drives if d.test == (part == "test")) + "]")
    (out / "meta.yaml").write_text("\n".join(meta) + "\n")


def _pose_rows(c: Case, d: Drive, rows: Array, rng: Rng) -> Array:
    """Poses as a recorder writes them: headings within a turn, and rows that come twice or too early."""
    if c.tamper == "" and c.says:
        rows[:, 3] = wrap(rows[:, 3])
    order, n = np.arange(len(rows)), len(rows)
    for i in rng.integers(5, n - 5, int(rng.integers(0, 3))).tolist() if rng.random() < 0.4 else []:
        order[i], order[i + 1] = (order[i + 1], order[i]) if rng.random() < 0.5 else (order[i], order[i])
    return rows if d.test else rows[order]


def write(folder: Path, c: Case, truth: dict[str, Any], rng: Rng) -> None:
    """The whole case."""
    out = folder / "recording"
    if out.exists():
        shutil.rmtree(out)
    out.mkdir(parents=True)
    _meta(c, out, rng)
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    repeated: Array | None = None
    for d in c.drives:
        place, zero = out / d.name, c.zero + d.start
        place.mkdir()
        _commands(place, c, d, zero, rng)
        got, asked = _readings(c, d, rng)
        stamps, poses = _poses(rng, c, d, d.stamps[asked])
        pairs = _motion_queries(rng, d, stamps, int(rng.integers(16, 29))) if d.test else []
        at = [int(np.argmin(np.abs(stamps - s))) for s in d.stamps[asked]]
        _off(rng, poses, {i for p in pairs for i in p} | set(at))
        if d.test:
            lines += _motion_answers(c, d, stamps, poses, pairs, zero, rng)
            for k, row in zip(asked.tolist(), at, strict=True):
                lines += _scan_answers(c, d, k, poses[row], got[k], zero, rng)
            spans = [(stamps[i], stamps[j]) for i, j in pairs] + [(s, s) for s in d.stamps[asked]]
            _table(place / "query.csv", ["t0", "t1"], np.array(sorted(spans)) + zero, [4, 4])
        t, p = _twist(c.tamper, stamps + zero, poses)
        if c.tamper == "poses of another drive":
            repeated, p = p, (p if repeated is None else repeated[np.arange(len(p)) % len(repeated)])
        rows = _pose_rows(c, d, np.column_stack([t, p]), rng)
        _table(place / "pose.csv", ["t", "x", "y", "theta"], rows, [4, 5, 5, 6])
        if c.scene.fan is not None:
            keep, n = np.setdiff1d(np.arange(d.stamps.size), np.concatenate([asked, asked + 1])), c.scene.fan.beams
            shown = got[keep, ::-1] if c.tamper == "mirrored fan" else got[keep]
            shown = shown * 1000 if c.tamper == "ranges in mm" else shown
            names = ["t", *(f"r{k}" for k in range(n))]
            _table(place / "scan.csv", names, np.column_stack([d.stamps[keep] + zero, shown]), [4] + [3] * n)
        if c.decoys or d.extra:
            _covariates(place, c, d, zero, rng)
    (folder / "answers.csv").write_text("\n".join(lines) + "\n")
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def _covariates(place: Path, c: Case, d: Drive, zero: float, rng: Rng) -> None:
    t = np.arange(0, d.duration, float(rng.choice([0.5, 1.0, 2.0])))
    columns = {name: np.interp(t, np.arange(values.size), values) for name, values in d.extra.items()}
    for name in c.decoys:
        trend = rng.normal(0, 0.3) * t / 60 + np.cumsum(rng.normal(0, 0.05, t.size))
        battery = 25.4 - 0.0008 * (t + d.start) + rng.normal(0, 0.02, t.size)
        columns[name] = battery if name == "battery" else 40 + 5 * trend
    rows = np.column_stack([t + zero, *columns.values()])
    _table(place / "covariate.csv", ["t", *columns], rows, [4] + [3] * len(columns))


def _motion_answers(
    c: Case, d: Drive, stamps: Array, poses: Array, pairs: list[tuple[int, int]], zero: float, rng: Rng
) -> list[str]:
    lines, spans = [], [(float(stamps[i]), float(stamps[j])) for i, j in pairs]
    guesses = [motions(d, spans, e, c.scene, rng) for e in ([], c.effects)]
    for (i, j), base, oracle in zip(pairs, *guesses, strict=True):
        values = relative(poses[i], poses[j]), *base, *oracle
        for k, channel in enumerate(("dx", "dy", "dtheta")):
            numbers = ",".join(f"{x[k]:.6f}" for x in values)
            lines.append(f"{d.name},{channel},{stamps[i] + zero:.4f},{stamps[j] + zero:.4f},,{numbers}")
    return lines


def _scan_answers(c: Case, d: Drive, index: int, row: Array, got: Array, zero: float, rng: Rng) -> list[str]:
    values = [got, *(x for e in ([], c.effects) for x in scans(d, index, row, e, c.scene, rng))]
    when, lines = f"{d.stamps[index] + zero:.4f}", []
    for b in np.flatnonzero(np.isfinite(got)).tolist():
        lines.append(f"{d.name},range,{when},{when},{b}," + ",".join(f"{x[b]:.5f}" for x in values))
    return lines
