# SPDX-License-Identifier: BSD-3-Clause
"""The files of a recording, the answers to its queries, and the ways in which data are wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml

from . import drive, laser
from .causes import is_base
from .lab import Lab
from .noise import ou, query_sd
from .plant import DT, Arr, convert, measure, rates, simulate

Table = dict[str, Arr]
Query = tuple[float, float]
Answer = tuple[object, ...]


@dataclass
class Recording:
    """Tables of each run by file name, and the rest."""

    runs: list[dict[str, Table]]
    meta: dict[str, object]
    world: str
    answers: list[Answer] = field(default_factory=list)


def wrap(a: Arr) -> Arr:
    """Into (-pi, pi]."""
    return np.asarray(np.arctan2(np.sin(a), np.cos(a)))


def inputs(lab: Lab, i: int) -> tuple[Table, Table, Table]:
    """Commands, voltages and odometry of a run, times since its start."""
    run, stamps = lab.runs[i], lab.commands[i]
    at = np.round(stamps / DT).astype(int)
    s = rates(run, [], np.tile(run.pose0, (len(run.v), 1)))
    convert(s)
    command = {"t": stamps, "v": run.v[at], "w": run.w[at]}
    voltage = {"t": stamps, "v_f": s.vf[at], "v_s": s.vs[at], "v": run.v[at], "w": run.w[at]}
    ideal = simulate(run, [], None).pose
    k = np.arange(25, len(run.v), 50)
    odom = {"t": k * DT, "x": ideal[k, 0], "y": ideal[k, 1], "theta": wrap(ideal[k, 2]), "v": run.v[k], "w": run.w[k]}
    return command, voltage, odom


def reference(lab: Lab, i: int, rng: np.random.Generator) -> tuple[Arr, Arr, Arr]:
    """Stamps, what the reference wrote, and which rows are off."""
    t, noise = lab.stamps[i], lab.noise
    stamped = t + noise.jitter * rng.standard_normal(len(t))
    order = np.argsort(stamped, kind="stable")
    fine = np.arange(0, lab.length[i] + 1, 0.02)
    rows = measure(lab.paths[i], t, [c for c in lab.causes if is_base(c)])
    white = (noise.position, noise.position, noise.heading)
    for c, sd in enumerate((noise.drift[0], noise.drift[0], noise.drift[1])):
        rows[:, c] += np.interp(t, fine, ou(rng, len(fine), 0.02, sd, noise.drift_tau)) + white[
            c
        ] * rng.standard_normal(len(t))
    off = np.zeros(len(t))
    if lab.flaws["off"]:
        bad = rng.choice(len(t), int(rng.integers(2, 7)), replace=False)
        off[bad] = 1
        rows[bad, :2] += rng.uniform(-0.6, 0.6, (len(bad), 2))
    return stamped[order], rows[order], off[order]


def scans(lab: Lab, i: int) -> tuple[Table, laser.Scene, laser.Scene]:
    """Scans of a run, and its scenes with and without the hidden causes."""
    seen = [c for c in lab.causes if not is_base(c)]
    scene, plain = lab.scene(i, seen), lab.scene(i, [])
    y = laser.rounded(laser.raw(scene, seen, lab.dice[i]), seen)
    return {"t": lab.scan_times[i], **{f"r{k}": y[:, k] for k in range(y.shape[1])}}, scene, plain


def covariates(lab: Lab, i: int, rng: np.random.Generator, names: list[str]) -> Table:
    """What else was logged."""
    quick = any(n in ("lean", "wind", "lamp", "collision") for n in names)
    t = np.arange(0.0, lab.length[i], 0.2 if quick else 1.0)
    digits = {"battery": 2, "temperature": 2, "humidity": 1, "lamp": 0, "seat_load": 1}
    out = {"t": t}
    for n in names:
        if n == "collision":
            out[n] = 1.0 - np.interp(t, lab.runs[i].t, lab.runs[i].free).round()
        else:
            out[n] = np.round(lab.column(n, lab.start[i] + t), digits.get(n, 3))
    return out


def motion_answers(lab: Lab, t: Arr, rows: Arr, off: Arr, rng: np.random.Generator) -> tuple[list[Query], list[Answer]]:
    """Queries of 1, 2 and 5 s of the test run, and their answers but for the name and the zero of time."""
    run, path, base = lab.runs[3], lab.paths[3], [c for c in lab.causes if is_base(c)]
    queries: list[Query] = []
    answers: list[Answer] = []
    open_, now = drive.activity(run, lab.noise.at_rest), 5.0
    means = [(simulate(run, causes, None, path.pose), causes) for causes in ([], base)]
    good = np.flatnonzero(off == 0)
    while now < t[-1] - 7:
        span = float(rng.choice([1.0, 2.0, 5.0]))
        a = good[np.argmin(np.abs(t[good] - now))]
        b = good[np.argmin(np.abs(t[good] - t[a] - span))]
        now = t[b] + rng.uniform(0.6, 2.5)
        grid = np.linspace(t[a], t[b], 200)
        where = np.clip((grid / DT).astype(int), 0, len(open_) - 1)
        if abs(t[b] - t[a] - span) > 0.15 or run.free[where].min() < 1:
            continue
        pair = np.array([t[a], t[b]])
        sd = query_sd(lab.noise, grid, path.pose[where], open_[where])
        value, base_mean, oracle = (between(m) for m in (rows[[a, b]], *(measure(p, pair, c) for p, c in means)))
        turns = 2 * np.pi * np.round((oracle[2] - value[2]) / (2 * np.pi))
        value[2] += turns
        queries.append((float(t[a]), float(t[b])))
        for k, channel in enumerate(("dx", "dy", "dtheta")):
            answers.append((channel, *queries[-1], "", value[k], base_mean[k], sd[k], oracle[k], sd[k]))
    return queries, answers


def between(rows: Arr) -> Arr:
    """Motion from the first row to the second in the frame of the first."""
    d = rows[1] - rows[0]
    c, s = np.cos(rows[0, 2]), np.sin(rows[0, 2])
    return np.array([c * d[0] + s * d[1], c * d[1] - s * d[0], d[2]])


def scan_answers(
    lab: Lab, table: Table, scene: laser.Scene, plain: laser.Scene, k: int, rng: np.random.Generator
) -> list[Answer]:
    """One scan, a row per beam that has a reading and should have one, edges left out."""
    seen = [c for c in lab.causes if not is_base(c)]
    t = float(table["t"][k])
    out: list[Answer] = []
    p = laser.pose_cov(lab.noise, scene.heading[k, 0], scene.speed[k])
    sd = []
    for s, group in ((plain, []), (scene, seen)):
        own = (laser.sigma(np.minimum(s.r[k], 6)) * laser.spread(s, group)[k]) ** 2 + 1e-6 / 12
        sd.append(np.sqrt(own + np.einsum("bi,ij,bj->b", s.jacobian[k], p, s.jacobian[k])))
    guess = np.linalg.cholesky(p) @ rng.standard_normal(3)  # the pose is known as well as one row of the reference
    m = laser.mean(plain, [])[k] + plain.jacobian[k] @ guess
    o = laser.saturated(laser.mean(scene, seen)[k] + scene.jacobian[k] @ guess, seen)
    edge = scene.edge[k] | plain.edge[k]
    for b in range(len(m)):
        value = float(table[f"r{b}"][k])
        if np.isfinite(value) and not edge[b] and min(m[b], o[b]) > 0.06 and max(m[b], o[b]) < 4.0:
            out.append(("range", t, t, b, value, m[b], sd[0][b], o[b], sd[1][b]))
    return out


def head(lab: Lab, rng: np.random.Generator) -> dict[str, object]:
    """What meta.yaml says."""
    meta: dict[str, object] = {"train": ["run_1", "run_2", "run_3"], "test": ["run_4"], "world": "room.world"}
    if rng.random() < 2 / 3:
        meta["truth"] = {"position_sd": round(lab.noise.position, 5), "heading_sd": round(lab.noise.heading, 5)}
    if lab.plan.scans:
        fan = lab.fan
        step, beams = round(0.006135923 * fan.every, 9), len(fan.bearing)
        mount = {"x": fan.x, "y": fan.y, "yaw": fan.yaw}
        meta["laser"] = {**mount, "angle_min": -2.086214, "angle_increment": step, "beams": beams}
    return meta


def logged(lab: Lab, rng: np.random.Generator) -> list[str]:
    """Names of the columns of covariate.csv."""
    names = [lab.plan.column] if lab.plan.column else []
    more = [n for n in ("battery", "temperature", "tyre_pressure", "humidity", "seat_load") if n not in names]
    names += rng.permutation(more)[: int(rng.integers(0 if names else 1, 3 - len(names)))].tolist()
    if lab.crash and rng.random() < 0.5:
        names = [*names[: 1 if lab.plan.column else 2], "collision"]
    return names


def without(table: Table, queries: list[Query]) -> Table:
    """A table without the 0.3 s before the end of each query."""
    keep = np.ones(len(table["t"]), dtype=bool)
    for _, end in queries:
        keep &= ~((table["t"] >= end - 0.3) & (table["t"] <= end))
    return {c: x[keep] for c, x in table.items()}


def record(lab: Lab, rng: np.random.Generator) -> Recording:
    """All tables, with times of day at last."""
    out, names = Recording([], head(lab, rng), lab.room.stage()), logged(lab, rng)
    volts = bool(rng.random() < 2 / 3)
    zero = 1.7e9 + float(rng.integers(10**7)) if lab.flaws["unix"] else 0.0
    for i in range(4):
        command, voltage, odom = inputs(lab, i)
        t, rows, off = reference(lab, i, rng)
        tables: dict[str, Table] = {"command": command, "odom": odom, "covariate": covariates(lab, i, rng, names)}
        tables |= {"voltage": voltage} if volts else {}
        queries: list[Query] = []
        answers: list[Answer] = []
        if i == 3:
            queries, answers = motion_answers(lab, t, rows, off, rng)
        if lab.plan.scans:
            table, scene, plain = scans(lab, i)
            asked = pick_scans(table["t"], queries, rng) if i == 3 else []
            for k in asked:
                answers += scan_answers(lab, table, scene, plain, k, rng)
            queries = sorted(queries + [(float(x), float(x)) for x in table["t"][asked]])
            tables["scan"] = without(table, queries)
        tables["pose"] = without({"t": t, "x": rows[:, 0], "y": rows[:, 1], "theta": wrap(rows[:, 2])}, queries)
        if i == 3:
            tables["query"] = {"t0": np.array([q[0] for q in queries]), "t1": np.array([q[1] for q in queries])}
        shift = zero + lab.start[i]
        for table in tables.values():
            table.update({c: np.round(table[c] + shift, 6) for c in ("t", "t0", "t1") if c in table})
        out.answers += dated(answers, shift)
        out.runs.append(tables)
    return out


def dated(rows: list[Answer], shift: float) -> list[Answer]:
    """Answers with the name of the run and the time of day."""
    return [("run_4", a[0], *(round(float(str(x)) + shift, 6) for x in a[1:3]), *a[3:]) for a in rows]


def pick_scans(t: Arr, queries: list[Query], rng: np.random.Generator) -> list[int]:
    """Some scans that are not close to the ends of the other queries, nor to each other's."""
    clear = [k for k in range(6, len(t)) if all(t[k] < a - 0.05 or t[k] > b + 0.05 for a, b in queries)
             and all(abs(t[k] - a) > 0.32 for a, _ in queries)]  # fmt: skip
    return sorted(int(k) for k in rng.permutation(clear)[: int(rng.integers(3, 7))])


def save(out: Path, r: Recording) -> None:
    """Write the recording and the answers."""
    folder = out / "recording"
    for i, tables in enumerate(r.runs):
        run = folder / f"run_{i + 1}"
        run.mkdir(parents=True, exist_ok=True)
        for name, table in tables.items():
            data = np.stack(list(table.values()), axis=1)
            formats = [
                "%.6f"
                if c.startswith("t") and c != "theta" and c != "temperature"
                else "%.4f"
                if c[0] == "r"
                else "%.7g"
                for c in table
            ]
            np.savetxt(run / f"{name}.csv", data, fmt=formats, delimiter=",", header=",".join(table), comments="")
    (folder / "meta.yaml").write_text(yaml.safe_dump(r.meta, sort_keys=False))
    (folder / "room.world").write_text(r.world)
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    for a in r.answers:
        lines.append(
            ",".join(
                x if isinstance(x, str) else f"{float(str(x)):.6f}" if k < 4 else f"{float(str(x)):.8g}"
                for k, x in enumerate(a)
            )
        )
    (out / "answers.csv").write_text("\n".join(lines) + "\n")
