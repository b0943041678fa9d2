# SPDX-License-Identifier: BSD-3-Clause
"""From drives to the tables of a recording, with what all real recordings contain."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml

from kurumaisu.bench.strangers.moor.answers import Answer, motions, ranges
from kurumaisu.bench.strangers.moor.drives import Setting
from kurumaisu.bench.strangers.moor.laser import Fan, Lenses, look, optics_of, passer, read, true_pose
from kurumaisu.bench.strangers.moor.motion import FORWARD, STEERING, Causes, Drive, Motion, to_volts
from kurumaisu.bench.strangers.moor.whiten import Noise
from kurumaisu.bench.strangers.moor.world import Array, Room
from kurumaisu.bench.strangers.moor.wrongs import Table, Tables


@dataclass
class Take:
    """Everything about one recording; `queries` are the rows of windows and the times of scans asked for."""

    seed: int
    setting: Setting
    room: Room
    noise: Noise
    fan: Fan | None
    base: Causes
    lenses: Lenses
    drives: list[Drive]
    motions: list[Motion]
    stamps: list[Array]
    scans: list[Array]
    asked: Array
    windows: Array
    tests: int = 1
    answers: list[Answer] = field(default_factory=list)


def row_stamps(rng: np.random.Generator, seconds: float, rate: float) -> Array:
    """Times of the reference's rows: uneven, with gaps, and in bursts for a while."""
    t = np.cumsum(np.maximum(rng.normal(1, 0.12, int(seconds * rate * 1.2)), 0.3)) / rate
    t = t[t < seconds - 0.3]
    if rng.random() < 0.4:
        begin = rng.uniform(0, seconds - 10)
        often = (t > begin) & (t < begin + 8)
        t = np.where(often, np.floor(t * 2) / 2 + (t * 2 % 1) * 0.3, t)
    for _ in range(rng.integers(0, 3)):
        gap = rng.uniform(5, seconds - 5)
        t = t[(t < gap) | (t > gap + rng.uniform(0.4, 2.0))]
    return np.asarray(np.unique(np.round(t, 4)))


def scan_stamps(rng: np.random.Generator, seconds: float, fan: Fan) -> Array:
    """Times of the first beams of scans."""
    t = 0.6 + np.cumsum(rng.normal(1, 0.02, int(seconds / fan.every))) * fan.every
    return np.asarray(np.round(t[t < seconds - 1.0], 4))


def measured(rng: np.random.Generator, take: Take, k: int, spared: Array) -> Array:
    """Poses as the reference gives them: noise for each row, a slow drift, a few rows that are off."""
    stamps, m = take.stamps[k], take.motions[k]
    late = stamps + rng.normal(0, 2e-4, stamps.size)
    size = np.array([take.noise.position, take.noise.position, take.noise.heading])
    pose = m.reference(late) + rng.normal(0, 1, (stamps.size, 3)) * size
    knots = np.arange(0, m.t[-1] + 20, 20.0)
    cov = take.noise.drift**2 * np.exp(-abs(knots[:, None] - knots) / 60)
    for i in range(2):
        pose[:, i] += np.interp(
            stamps, knots, np.linalg.cholesky(cov + 1e-12 * np.eye(knots.size)) @ rng.normal(0, 1, knots.size)
        )
    free = np.setdiff1d(np.arange(5, stamps.size - 5), spared)
    for i in rng.choice(free, int(rng.integers(0, 4)), replace=False):
        pose[i, :2] += rng.choice([-1, 1], 2) * rng.uniform(0.08, 0.4, 2)
    return np.asarray(pose)


def windows_of(take: Take) -> list[tuple[int, int]]:
    """Rows at which the windows asked for begin and end."""
    stamps, rows = take.stamps[-1], []
    for begin in take.windows:
        i = int(np.searchsorted(stamps, begin))
        for ahead in (0.5, 1, 2, 4):
            j = int(np.argmin(abs(stamps - stamps[i] - ahead)))
            if j > i and abs(stamps[j] - stamps[i] - ahead) < 0.2:
                rows.append((i, j))
    return sorted(set(rows))


def tables_of(take: Take) -> tuple[Tables, dict[str, float]]:
    """All tables, and answers by the way; and the drives' offsets to the clock of the day."""
    rng = np.random.default_rng([take.seed, 21])
    out = Tables({}, take.room, [])
    offsets: dict[str, float] = {}
    for k, (d, m) in enumerate(zip(take.drives, take.motions, strict=True)):
        name, last = f"run_{k + 1}", k == len(take.drives) - 1
        offsets[name] = take.setting.unix + (k * 600 + int(rng.integers(0, 200)) if take.setting.unix else 0.0)
        rows = windows_of(take) if last else []
        spared = np.concatenate([np.array(rows, dtype=int).ravel(), np.searchsorted(take.stamps[k], take.asked)])
        pose = np.round(measured(rng, take, k, spared if last else np.zeros(0, dtype=int)), 5)
        stamps, keep = take.stamps[k], np.ones(take.stamps[k].size, dtype=bool)
        parts: dict[str, Table] = {}
        if take.fan is not None:
            c = look(m, true_pose(m), take.scans[k], take.fan, take.room, optics_of(take.lenses), take.seed)
            near = passer(rng, c, true_pose(m)(c.t)[:2]) if k == 1 and rng.random() < 0.4 else None
            z = read(rng, c, take.lenses, near)
            left = ~np.isin(take.scans[k], take.asked) if last else np.ones(len(z), dtype=bool)
            parts["scan"] = {"t": take.scans[k][left]} | {f"r{i}": z[left, i] for i in range(z.shape[1])}
        if last:
            for i, j in rows:
                keep[i + 1 : j + 1] = False
            take.answers += motions(name, d, take.base, m, stamps, pose, rows, take.noise)
            for stamp in take.asked if take.fan is not None else []:
                assert take.fan is not None
                at = int(np.searchsorted(stamps, stamp))
                row = int(np.flatnonzero(take.scans[k] == stamp)[0])
                take.answers += ranges(
                    name, d, take.base, take.lenses, take.fan, take.room, float(stamp), pose[at], z[row], take.noise
                )  # fmt: skip
            ends = [(stamps[i], stamps[j]) for i, j in rows] + [(s, s) for s in take.asked if take.fan is not None]
            parts["query"] = {"t0": np.array([e[0] for e in ends]), "t1": np.array([e[1] for e in ends])}
        wrapped = (pose[:, 2] + np.pi) % (2 * np.pi) - np.pi
        parts["pose"] = {"t": stamps[keep], "x": pose[keep, 0], "y": pose[keep, 1], "theta": np.round(wrapped, 5)[keep]}
        v, w = d.v[d.ticks], d.w[d.ticks]
        if d.volts:
            parts["voltage"] = {
                "t": d.t[d.ticks],
                "v_f": to_volts(v, FORWARD),
                "v_s": to_volts(w, STEERING),
                "v": v,
                "w": w,
            }
        else:
            parts["command"] = {"t": d.t[d.ticks], "v": v, "w": w}
        if d.columns:
            parts["covariate"] = {"t": d.t[::50]} | {n: x[::50] for n, x in d.columns.items()}
            if take.setting.contact:
                parts["covariate"]["collision"] = 1.0 - d.free[::50]
        for table in parts.values():
            table.update({key: table[key] + offsets[name] for key in ("t", "t0", "t1") if key in table})
        out.drives[name] = parts
    out.train = list(out.drives)[: len(take.drives) - take.tests]
    return out, offsets


def save(path: Path, table: Table) -> None:
    """Write a table."""
    clocks = ("t", "t0", "t1")
    form = ["%.4f" if n in clocks else "%.3f" if n[0] == "r" and n[1:].isdigit() else "%.6g" for n in table]
    np.savetxt(path, np.stack(list(table.values()), axis=1), form, ",", header=",".join(table), comments="")


def write(out: Path, take: Take, tables: Tables, offsets: dict[str, float]) -> None:
    """Write recording/ and answers.csv."""
    folder = out / "recording"
    meta: dict[str, object] = {"train": tables.train, "test": [n for n in tables.drives if n not in tables.train]}
    if not take.setting.volts:
        meta["robot"] = "velocity"
    if take.seed // 8 % 2 == 0:
        meta["truth"] = {"position_sd": round(take.noise.position, 5), "heading_sd": round(take.noise.heading, 5)}
    if take.fan is not None:
        f = take.fan
        meta["world"] = "room.world"
        meta["laser"] = {
            "x": 0.30,
            "y": 0.0,
            "yaw": 0.0,
            "angle_min": f.first,
            "angle_increment": f.step,
            "beams": f.beams,
        }
        meta["laser"] |= {"time_increment": f.dt}  # type: ignore[operator]
    for name, parts in tables.drives.items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        for part, table in parts.items():
            save(folder / name / f"{part}.csv", table)
    if take.fan is not None:
        (folder / "room.world").write_text(tables.room.stage())
    (folder / "meta.yaml").write_text(yaml.safe_dump(meta, sort_keys=False))
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    for run, channel, t0, t1, beam, numbers in take.answers:
        clock = f"{t0 + offsets[run]:.4f},{t1 + offsets[run]:.4f}"
        lines.append(f"{run},{channel},{clock},{beam}," + ",".join(f"{x:.6f}" for x in numbers))
    (out / "answers.csv").write_text("\n".join(lines) + "\n")
