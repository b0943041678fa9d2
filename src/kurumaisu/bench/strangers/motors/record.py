# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a recording, the queries of its test, and what is true about it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import laser
from .measure import observe, path
from .noise import integral_sd
from .plant import TRACK, VOLTS, Array, H, volts
from .trial import Trial

Table = tuple[list[str], Array]


@dataclass
class Recording:
    """Tables by run, the world and the other entries of meta.yaml, and rows of answers.csv."""

    runs: list[dict[str, Table]]
    world: str
    meta: dict[str, str]
    answers: list[list[str]]


def _covariates(trial: Trial, run: int, rng: np.random.Generator) -> Table:
    t = np.arange(0.05, trial.ends[run], 0.5 if trial.flags["collision"] else 1.0)
    k = np.minimum((t / H).astype(int), trial.steps - 1)
    sag = sum(trial.full.get(n, 0.0) for n in ("sag",)) * t + trial.full.get("low", 0.0) / VOLTS
    load = np.abs(trial.motion.rim[k]).sum(axis=1)[:, run]
    end = trial.full.get("collapse", 0.0) * np.maximum(t / trial.ends[run] - 0.7, 0) ** 2 / 0.09
    battery = VOLTS * (1 - sag - end) - 0.004 * t - 0.25 * load + rng.normal(0, 0.02, len(t))
    warm = trial.warmth[run] + 0.002 * t + rng.normal(0, 0.02, len(t))
    pressure = 2.4 + 0.2 * trial.out.pressure[k, run] + rng.normal(0, 0.004, len(t))
    all_ = {"battery": battery, "temperature": warm, "pressure": pressure}
    keep = [n for n in all_ if n in trial.logged]
    data = [t, *(np.round(all_[n], 3) for n in keep)]
    if trial.flags["collision"] and trial.log_hit:
        keep.append("collision")
        data.append(1.0 * (trial.out.blocked[k, run] > 0))
    return ["t", *keep], np.stack(data, axis=1)


def _odometry(trial: Trial, run: int) -> Table:
    rim = trial.motion.rim[: int(trial.ends[run] / H), :, run]
    v, w = rim.mean(axis=1), (rim[:, 1] - rim[:, 0]) / TRACK
    p = path(v, w, 0 * v)[1:]
    i = np.arange(4, len(v), 3)
    return ["t", "x", "y", "theta", "v", "w"], np.round(np.column_stack([(i + 1) * H, p[i], v[i], w[i]]), 5)


def tables(trial: Trial, rng: np.random.Generator) -> Recording:
    """Everything that was recorded."""
    if trial.scanned:
        faults = {k: v for f in trial.laser for k, v in f.fault().items()}
        moved = set(faults) & laser.GEOMETRY - {"map_sd", "map_scale"}
        view = laser.look(trial.scans, {k: v for k, v in faults.items() if k in moved}) if moved else trial.view
        readings, _ = laser.read(rng, trial.scans, view, faults, trial.speed)
    runs: list[dict[str, Table]] = []
    both = rng.random() < 2 / 3
    for run in range(4):
        n = int(trial.ends[run] / H)
        at = trial.times < trial.ends[run]
        t, c = trial.times[at], trial.motion.rows[: len(trial.times), :, run][at]
        one: dict[str, Table] = {"command": (["t", "v", "w"], np.column_stack([t, c]))}
        if both:
            one["voltage"] = (
                ["t", "v_f", "v_s"],
                np.column_stack([t, np.round(np.stack(volts(c[:, 0], c[:, 1]), axis=1), 6)]),
            )
        one["odom"] = _odometry(trial, run)
        r = trial.rows[run]
        p = observe(
            trial.motion.pose[: n + 1, :, run], trial.motion.pose[: n + 1, :, run], r.taken, trial.full, trial.room
        )
        p = p + r.error
        p[:, 2] = (p[:, 2] + np.pi) % (2 * np.pi) - np.pi
        one["pose"] = (["t", "x", "y", "theta"], np.column_stack([r.stamp, np.round(p, 6)]))
        if trial.scanned:
            here = trial.scans.run == run
            one["scan"] = (
                ["t", *(f"r{i}" for i in range(readings.shape[1]))],
                np.column_stack([trial.scans.t[here], readings[here]]),
            )
        one["covariate"] = _covariates(trial, run, rng)
        runs.append(one)
    boxes = laser.mapped(trial.room, trial.scans, {k: v for f in trial.laser for k, v in f.fault().items()})
    dark = any(f.cause.id == "laser.reflectance" for f in trial.laser)
    every = trial.scans.every
    meta = {"train": "[run_1, run_2, run_3]", "test": "[run_4]", "world": "room.world"}
    if rng.random() < 2 / 3:
        drift = (
            np.hypot(trial.noise.position, trial.noise.drift),
            np.hypot(trial.noise.heading, trial.noise.drift_heading),
        )
        meta["truth"] = f"{{position_sd: {drift[0]:.4f}, heading_sd: {drift[1]:.4f}}}"
    beams = (laser.BEAMS + every - 1) // every
    fan = f"angle_min: {laser.ANGLE}, angle_increment: {laser.STEP * every:.9f}, beams: {beams}"
    meta["laser"] = f"{{x: 0.30, y: 0.0, yaw: 0.0, {fan}}}"
    recording = Recording(runs, trial.room.text(boxes, dark), meta, [])
    queries(trial, recording, rng)
    shift = np.array([0.0, 600.0, 1500.0, 2100.0]) + (1.7e9 + rng.integers(1, 9999999) if trial.flags["unix"] else 0)
    for run, one in enumerate(recording.runs):
        offset = shift[run] if trial.flags["unix"] else 0.0
        for head, a in one.values():
            a[:, 0] += offset
            if head[:2] == ["t0", "t1"]:
                a[:, 1] += offset
    for row in recording.answers:
        row[2:4] = [f"{float(x) + (shift[3] if trial.flags['unix'] else 0.0):.6f}" for x in row[2:4]]
    return recording


def queries(trial: Trial, rec: Recording, rng: np.random.Generator) -> None:
    """Choose queries in the last run, answer them, and take away what would answer them."""
    one = rec.runs[3]
    pose, r = one["pose"][1], trial.rows[3]
    hit = trial.hit[3]
    asked: list[tuple[float, float]] = []
    for _ in range(60):
        i = int(rng.integers(5, len(pose) - 5))
        j = int(np.searchsorted(pose[:, 0], pose[i, 0] + rng.choice([1.0, 2.0, 5.0])))
        clear = pose[min(j, len(pose) - 1), 0] < hit[0] - 0.3 or pose[i, 0] > hit[1] + 0.5
        alone = all(abs(t1 - pose[i, 0]) > 0.4 for _, t1 in asked)
        alone = (
            alone and j < len(pose) and all(not t1 - 0.35 < t0 < t1 + 0.05 for t0, _ in asked for t1 in [pose[j, 0]])
        )
        if clear and alone and len(asked) < 12 and not r.off[i] and not r.off[j]:
            asked.append((pose[i, 0], pose[j, 0]))
            rec.answers += _motion(trial, pose, i, j)
    drop = np.zeros(len(pose), bool)
    if trial.scanned:
        scans = one["scan"][1]
        free = [k for k in range(8, len(scans)) if all(not -0.05 < scans[k, 0] - t0 < 0.35 for t0, _ in asked)]
        chosen = rng.choice(free, min(5, len(free)), replace=False)
        for k in chosen:
            asked.append((scans[k, 0], scans[k, 0]))
            rec.answers += _scan(trial, k, scans[k, 1:])
        one["scan"] = (one["scan"][0], np.delete(scans, chosen, axis=0))
    for _, t1 in asked:
        drop |= (pose[:, 0] > t1 - 0.3) & (pose[:, 0] <= t1 + 1e-9)
    one["pose"] = (one["pose"][0], pose[~drop])
    one["query"] = (["t0", "t1"], np.array(sorted(asked)))


def _motion(trial: Trial, pose: Array, i: int, j: int) -> list[list[str]]:
    a, b = pose[i], pose[j]
    real = _step(a[1:], b[1:])
    t, noise = trial.rows[3].taken[[i, j]], trial.noise
    base = trial.meter.increments(3, 1, {}, t)[0]
    oracle = trial.meter.increments(3, 2, trial.full, t)[0]
    span = t[1] - t[0]
    k = slice(int(t[0] / H), int(t[1] / H) + 1)
    v, w = trial.motion.v[k, 2, 3], trial.motion.w[k, 2, 3]
    way = path(v, w, 0 * v)
    p = way[:, 2]
    fine = np.abs(v) + np.abs(w) > 1e-3
    go = float(np.mean(fine))
    along, turn = integral_sd(span, noise.sd_v, noise.tau) * go, integral_sd(span, noise.sd_w, noise.tau) * go
    white, head = np.sqrt(2) * np.hypot(noise.position, noise.stamp * np.mean(abs(v))), np.sqrt(2) * noise.heading
    slow = np.sqrt(2 - 2 * np.exp(-span / noise.slow))
    # a wrong heading at t0 turns the whole motion, a wrong turn on the way what is left of it
    ahead = ((way[-1, :2] - way[:, :2]) ** 2).mean(axis=0) * turn**2
    swing = ahead[::-1] + (oracle[1::-1] * np.hypot(noise.heading, noise.drift_heading)) ** 2
    c2 = float(np.mean(np.cos(p) ** 2))
    common = white**2 + (slow * noise.drift) ** 2
    aside = integral_sd(span, noise.sd_side, noise.tau) * go
    sd = [
        np.sqrt(common + along**2 * c2 + aside**2 * (1 - c2) + swing[0]),
        np.sqrt(common + along**2 * (1 - c2) + aside**2 * c2 + swing[1]),
        np.sqrt(turn**2 + head**2 + (slow * noise.drift_heading) ** 2),
    ]
    out = []
    for c, name in enumerate(("dx", "dy", "dtheta")):
        value = real[c] if c < 2 else real[c] + 2 * np.pi * np.round((oracle[c] - real[c]) / (2 * np.pi))
        numbers = [f"{x:.6f}" for x in (value, base[c], sd[c], oracle[c], sd[c])]
        out.append(["run_4", name, f"{a[0]:.6f}", f"{b[0]:.6f}", "", *numbers])
    return out


def _step(a: Array, b: Array) -> Array:
    d, c, s = b - a, np.cos(a[2]), np.sin(a[2])
    return np.array([d[0] * c + d[1] * s, -d[0] * s + d[1] * c, (d[2] + np.pi) % (2 * np.pi) - np.pi])


def _scan(trial: Trial, k: int, readings: Array) -> list[list[str]]:
    here = np.flatnonzero(trial.scans.run == 3)[k]
    full = {a: b for f in trial.laser for a, b in f.fault().items()}
    still = {a: b for a, b in full.items() if not a.startswith("map")}
    on_map = {a: b for a, b in full.items() if a.startswith("map")}
    answers = [trial.level(on_map), trial.level(still)]
    pose_sd = np.array([trial.noise.position, trial.noise.position, trial.noise.heading])
    add = (trial.view.jac[:, here] ** 2 * pose_sd[:, None] ** 2).sum(axis=0)
    r = trial.rows[3]  # both means by the pose that the reference gave last, with its error
    before = np.flatnonzero(~r.off & (r.taken <= trial.scans.t[here]))
    error = r.error[before[-1]] if len(before) else np.zeros(3)
    head = trial.view.pose[2, here, 0]
    body = [
        error[0] * np.cos(head) + error[1] * np.sin(head),
        error[1] * np.cos(head) - error[0] * np.sin(head),
        error[2],
    ]
    off = np.where(trial.view.edge[here], 0.0, np.array(body) @ trial.view.jac[:, here])
    out = []
    for b, value in enumerate(readings):
        numbers = [f"{value:.3f}"]
        for mean, sd in answers:
            good = mean[here, b] < 3.99
            numbers += (
                [f"{mean[here, b] + off[b]:.5f}", f"{np.sqrt(sd[here, b] ** 2 + add[b]):.5f}"]
                if good
                else ["nan", "nan"]
            )
        t = f"{trial.scans.t[here]:.6f}"
        out.append(["run_4", "range", t, t, str(b), *numbers])
    return out


def write(out: Path, rec: Recording, truth: dict[str, Any]) -> None:
    """All files."""
    for run, one in enumerate(rec.runs, 1):
        folder = out / "recording" / f"run_{run}"
        folder.mkdir(parents=True, exist_ok=True)
        for name, (head, a) in one.items():
            times = 2 if name == "query" else 1
            rows = [
                ",".join([f"{x:.6f}" for x in row[:times]] + [f"{x:.10g}" for x in row[times:]]) for row in a.tolist()
            ]
            (folder / f"{name}.csv").write_text("\n".join([",".join(head), *rows]) + "\n")
    (out / "recording" / "meta.yaml").write_text("".join(f"{k}: {v}\n" for k, v in rec.meta.items()))
    (out / "recording" / "room.world").write_text(rec.world)
    title = "run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"
    (out / "answers.csv").write_text("\n".join([title, *(",".join(answer) for answer in rec.answers)]) + "\n")
    (out / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
