# SPDX-License-Identifier: BSD-3-Clause
"""Writes a case: tables as they come from real recorders, the truth, and the answers."""
from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.params import shipped

from .answers import motions, scans
from .chair import Noise
from .core import PUBLISHED, TRANSLATION, Array, Effect, Law, wrap
from .drives import Drive, Reference, measure, stamped, true_time
from .laser import Fan, look, read
from .rooms import Room

MODEL = shipped("launch/md100.yaml")

@dataclass
class Case:
    """Everything that happened."""
    drives: list[Drive]
    effects: list[Effect]
    noise: Noise
    ref: Reference
    law: Law
    room: Room | None
    fan: Fan | None
    scan_rate: float
    zero: float
    voltages: bool
    decoys: list[str]
    dead: Array = field(default_factory=lambda: np.zeros(0, dtype=int))
    tamper: str = ""
    says: bool = False

def _table(path: Path, names: Sequence[str], rows: Array, digits: Sequence[int]) -> None:
    form = ["%%.%df" % n for n in digits]
    with path.open("w") as f:
        f.write(",".join(names) + "\n")
        for row in rows.tolist():
            f.write(",".join("nan" if x != x else "inf" if x == np.inf else p % x for p,
                             x in zip(form, row, strict=True)) + "\n")

def _reference_times(rng: np.random.Generator, c: Case, d: Drive) -> Array:
    t = np.arange(0.05, d.duration - 0.05, 1 / c.ref.rate)
    t = t + rng.uniform(-0.25, 0.25, t.size) / c.ref.rate * rng.random()
    keep = np.ones(t.size, dtype=bool)
    for _ in range(int(rng.integers(0, 4))):
        at = rng.uniform(5, d.duration - 5)
        keep &= np.abs(t - at) > rng.uniform(0.1, 0.7)
    if rng.random() < 0.3:
        at, long = rng.uniform(0, d.duration * 0.6), rng.uniform(5, 20)
        keep &= ~((t > at) & (t < at + long) & (np.arange(t.size) // 3 % 3 == 1))
    return np.asarray(t[keep])

def _off(rng: np.random.Generator, poses: Array, spare: set[int]) -> None:
    for i in rng.integers(10, len(poses) - 10, int(rng.integers(0, 5))).tolist():
        if i not in spare:
            poses[i, :2] += rng.uniform(0.05, 0.4) * np.array([np.cos(i), np.sin(i)])

def _poses(rng: np.random.Generator, c: Case, d: Drive, needed: Array) -> tuple[Array, Array]:
    t = np.concatenate([_reference_times(rng, c, d), true_time(needed, d.start, c.effects)])
    t = np.sort(np.unique(np.round(t, 5)))
    stamps = np.round(stamped(t, d.start, c.effects), 4)
    return stamps, measure(rng, c.ref, d, true_time(stamps, d.start, c.effects), c.effects)

def _motion_queries(rng: np.random.Generator, d: Drive, stamps: Array, count: int) -> list[tuple[int, int]]:
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

def _commands(folder: Path, c: Case, d: Drive, zero: float, rng: np.random.Generator) -> None:
    k = d.commands
    v, w = k.v, k.w
    if c.tamper == "commands in km/h":
        v = v * 3.6
    if c.tamper == "speed of the wrong sign":
        v = -v
    if c.tamper == "yaw rate of the wrong sign":
        w = -w
    if c.voltages:
        volts = [np.round(TRANSLATION.volts(v), 5), np.round(c.law.volts(w), 5)]
        if c.tamper == "voltages in mV":
            volts = [1000 * x for x in volts]
        names, columns, digits = ["t", "v_f", "v_s"], [k.t + zero, *volts], [4, 5, 5]
        if c.law is PUBLISHED or rng.random() < 0.5:
            names, columns, digits = [*names, "v", "w"], [*columns, v, w], [*digits, 5, 5]
        _table(folder / "voltage.csv", names, np.stack(columns, axis=1), digits)
    if not c.voltages or rng.random() < 0.3:
        _table(folder / "command.csv", ["t", "v", "w"], np.stack([k.t + zero, v, w], axis=1), [4, 5, 5])

def _twist(c: Case, t: Array, poses: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    p, t = poses.copy(), t.copy()
    if c.tamper == "positions in mm":
        p[:, :2] *= 1000
    elif c.tamper == "headings in degrees":
        p[:, 2] = np.degrees(wrap(p[:, 2]))
    elif c.tamper == "y of the wrong sign":
        p[:, 1] *= -1
    elif c.tamper == "x and y swapped":
        p[:, :2] = p[:, 1::-1]
    elif c.tamper == "heading clockwise":
        p[:, 2] *= -1
    elif c.tamper == "heading of a compass":
        p[:, 2] = np.pi / 2 - p[:, 2]
    elif c.tamper == "clock of the reference is shifted":
        t += 3.7
    elif c.tamper == "times of the reference in ms":
        t *= 1000
    return t, p

def _readings(c: Case, d: Drive, rng: np.random.Generator) -> tuple[Array, Array]:
    assert c.room is not None and c.fan is not None
    extra = {k: (np.arange(v.size), v) for k, v in d.extra.items()}
    seen = look(c.room, d.motion.at, d.stamps, c.fan, c.effects, start=d.start, extra=extra)
    got = read(seen, c.effects, rng)
    got[:, c.dead] = np.nan
    return got, seen.mu

def write(folder: Path, c: Case, truth: dict[str, Any], rng: np.random.Generator) -> None:
    """The whole case."""
    out = folder / "recording"
    if out.exists():
        shutil.rmtree(out)
    out.mkdir(parents=True)
    text = MODEL.read_text()
    if c.law is not PUBLISHED:
        text = text.replace("voltage_law: published ", "voltage_law: corrected ", 1)
    (out / "md100.yaml").write_text(text)
    meta: list[str] = ["model: md100.yaml"]
    if c.fan is not None and c.room is not None:
        f = c.fan
        shown = c.room
        if c.tamper == "another map":
            from .rooms import draw
            shown = draw(np.random.default_rng(int(rng.integers(1 << 30))))
        (out / "room.world").write_text(shown.world())
        meta += ["world: room.world", f"laser: {{x: {f.x}, y: {f.y}, yaw: {f.yaw}, angle_min: {f.angle_min:.7f}, "
                 f"angle_increment: {f.angle_increment:.9f}, beams: {f.beams}, "
                 f"time_increment: {f.time_increment:.8e}}}"]
    if c.says:
        meta.append(f"truth: {{position_sd: {np.hypot(c.ref.sd, c.ref.wander):.5f}, heading_sd: {c.ref.sd_th:.5f}}}")
    meta.append("train: [" + ", ".join(d.name for d in c.drives if not d.test) + "]")
    meta.append("test: [" + ", ".join(d.name for d in c.drives if d.test) + "]")
    (out / "meta.yaml").write_text("\n".join(meta) + "\n")
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    repeated: Array | None = None
    for d in c.drives:
        place = out / d.name
        place.mkdir()
        zero = c.zero + d.start
        _commands(place, c, d, zero, rng)
        asked = np.zeros(0, dtype=int)
        got = np.zeros((0, 0))
        if c.fan is not None:
            got, mu = _readings(c, d, rng)
            if d.test:
                good = [i for i in range(3, d.stamps.size - 3) if np.isfinite(got[i]).sum() > 20]
                asked = np.sort(rng.choice(good, min(int(rng.integers(6, 11)), len(good)),
                                           replace=False)) if good else asked
                asked = asked[np.diff(asked, prepend=-9) > 1]
        stamps, poses = _poses(rng, c, d, d.stamps[asked])
        pairs = _motion_queries(rng, d, stamps, int(rng.integers(16, 29))) if d.test else []
        at = [int(np.argmin(np.abs(stamps - s))) for s in d.stamps[asked]]
        _off(rng, poses, {i for p in pairs for i in p} | set(at))
        if d.test:
            lines += _answers(c, d, stamps, poses, pairs, asked, at, got, zero, rng)
            rows = [(stamps[i], stamps[j]) for i, j in pairs] + [(d.stamps[k], d.stamps[k]) for k in asked.tolist()]
            _table(place / "query.csv", ["t0", "t1"], np.array(sorted(rows)) + zero, [4, 4])
        t, p = _twist(c, stamps + zero, poses, rng)
        if c.tamper == "poses of another drive":
            repeated, p = p, (p if repeated is None else repeated[np.arange(len(p)) % len(repeated)])
        p[:, 2] = wrap(p[:, 2]) if c.tamper == "" and c.says else p[:, 2]
        order = np.arange(len(t))
        for i in rng.integers(5, len(t) - 5, int(rng.integers(0, 3))).tolist() if rng.random() < 0.4 else []:
            order[i], order[i + 1] = (order[i + 1], order[i]) if rng.random() < 0.5 else (order[i], order[i])
        order = order if not d.test else np.arange(len(t))
        _table(place / "pose.csv", ["t", "x", "y", "theta"], np.column_stack([t, p])[order], [4, 5, 5, 6])
        if c.fan is not None:
            keep = np.setdiff1d(np.arange(d.stamps.size), np.concatenate([asked, asked + 1]))
            shown_scans = got[keep]
            if c.tamper == "mirrored fan":
                shown_scans = shown_scans[:, ::-1]
            if c.tamper == "ranges in mm":
                shown_scans = shown_scans * 1000
            _table(place / "scan.csv", ["t", *(f"r{k}" for k in range(c.fan.beams))],
                   np.column_stack([d.stamps[keep] + zero, shown_scans]), [4] + [3] * c.fan.beams)
        if c.decoys or d.extra:
            _covariates(place, c, d, zero, rng)
    (folder / "answers.csv").write_text("\n".join(lines) + "\n")
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")

def _covariates(place: Path, c: Case, d: Drive, zero: float, rng: np.random.Generator) -> None:
    t = np.arange(0, d.duration, float(rng.choice([0.5, 1.0, 2.0])))
    names, columns = ["t"], [t + zero]
    for name, values in d.extra.items():
        names.append(name)
        columns.append(np.interp(t, np.arange(values.size), values))
    for name in c.decoys:
        names.append(name)
        trend = rng.normal(0, 0.3) * t / 60 + np.cumsum(rng.normal(0, 0.05, t.size))
        columns.append({"battery": 25.4 - 0.0008 * (t + d.start) + rng.normal(0, 0.02, t.size)}.get(name,
                                                                                                    40 + 5 * trend))
    _table(place / "covariate.csv", names, np.column_stack(columns), [4] + [3] * (len(names) - 1))

def _answers(c: Case, d: Drive, stamps: Array, poses: Array, pairs: list[tuple[int, int]], asked: Array, at: list[int],
             got: Array, zero: float, rng: np.random.Generator) -> list[str]:
    from .drives import relative
    lines = []
    spans = [(float(stamps[i]), float(stamps[j])) for i, j in pairs]
    guesses = [motions(d, spans, e, c.law, c.noise, c.ref, rng) for e in ([], c.effects)]
    for n, (i, j) in enumerate(pairs):
        value = relative(poses[i], poses[j])
        for k, channel in enumerate(("dx", "dy", "dtheta")):
            (bm, bs), (om, os_) = guesses[0][n], guesses[1][n]
            numbers = ",".join(f"{x[k]:.6f}" for x in (value, bm, bs, om, os_))
            lines.append(f"{d.name},{channel},{stamps[i] + zero:.4f},{stamps[j] + zero:.4f},,{numbers}")
    for k, row in zip(asked.tolist(), at, strict=True):
        assert c.room is not None and c.fan is not None
        (bm, bs), (om, os_) = (scans(d, float(d.stamps[k]), k, poses[row], e, c.room, c.fan, c.ref, rng)
                               for e in ([], c.effects))
        when = d.stamps[k] + zero
        for b in np.flatnonzero(np.isfinite(got[k])).tolist():
            numbers = ",".join(f"{x[b]:.5f}" for x in (got[k], bm, bs, om, os_))
            lines.append(f"{d.name},range,{when:.4f},{when:.4f},{b},{numbers}")
    return lines
