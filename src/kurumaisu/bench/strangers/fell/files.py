# SPDX-License-Identifier: BSD-3-Clause
"""The recording's files, its queries and their answers."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.fell.judge import mean_poses, motion_cov, motions
from kurumaisu.bench.strangers.fell.laser import P0, REACH0, Laser, Where, clipped, readings
from kurumaisu.bench.strangers.fell.plant import DT, FWD, LAWS, Array, Cause, Pose, Rng, to_volts
from kurumaisu.bench.strangers.fell.room import draw_room
from kurumaisu.bench.strangers.fell.scene import Drive, Scene, laser_ctx, reported
from kurumaisu.params import shipped

Texts = dict[str, str]
Queries = tuple[list[tuple[int, int]], list[int]]  # rows of the poses that motions begin and end with, and scans


def _model(sc: Scene) -> str:
    """Return model.yaml: the wheelchair's, with this robot's law and laser."""
    text, put, a = shipped("launch/md100.yaml").read_text(encoding="utf-8"), dict[str, Any](), sc.las
    put["voltage_law"] = sc.robot.law
    if a:
        put |= {"angle_min": a.angle_min, "angle_increment": a.increment, "beams": a.beams, "scan_time": a.scan_time}
        put |= {"time_increment": a.tinc, "scale": a.scale, "datum_offset": a.datum, "sigma": list(a.sigma)}
        put |= {"range_min": a.near, "range_max": a.far}
        put["mount"] = f"{{x: {a.mount[0]}, y: {a.mount[1]}, z: {a.height}, yaw: {a.mount[2]}}}"
    for key, value in put.items():
        text = re.sub(rf"^(\s*{key}:)[^#\n]*", rf"\g<1> {value} ", text, count=1, flags=re.MULTILINE)
    return text


def _table(head: str, cols: Array, fmt: str) -> str:
    return head + "\n" + "".join(fmt % tuple(r) + "\n" for r in cols)


def _queries(rng: Rng, d: Drive) -> Queries:
    """Choose what is asked for."""
    out, t = list[tuple[int, int]](), d.tp[0] + rng.uniform(1, 4)
    while t < d.tp[-1] - 4 and len(out) < 28:
        i, j = (int(np.searchsorted(d.tp, u)) for u in (t, t + rng.uniform(1.7, 2.3)))
        if not d.off[[i, j]].any() and 1.4 < d.tp[j] - d.tp[i] < 2.7:
            out.append((i, j))
        t = d.tp[j] + rng.uniform(1.2, 4.5)
    scans = [
        k
        for k, s in enumerate(d.ts)
        if all(not d.tp[i] - 0.3 < s < d.tp[j] + 0.6 for i, j in out)
        and min(abs(d.tp - s)) < 0.2
        and np.isfinite(d.scans[k]).sum() > 10
        and not d.off[abs(d.tp - s) < 0.3].any()
    ]
    return out, sorted(rng.permutation(scans)[:9].tolist())


def _moved(where: Where, by: Array) -> Where:
    def moved(t: Array) -> Pose:
        x, y, th = where(t)
        return x + by[0], y + by[1], th + by[2]

    return moved


def _extra(causes: list[Cause]) -> float:
    """Return the variance of readings that is not in their scatter."""
    out = 1e-7 + P0 * REACH0**2
    for c in causes:
        if c.id == "laser.common_mode":
            out += c.p["sd"] ** 2
        elif c.id == "laser.quantisation":
            out += c.p["step"] ** 2 / 12
        elif c.id == "laser.heavy_tails":
            out += c.p["outliers"] * c.p["reach"] ** 2
    return out


def _expected(rng: Rng, sc: Scene, las: Laser, d: Drive, s: Array) -> tuple[list[Array], bool]:
    """Return mean and sd of a scan's readings without and with the causes, and whether beams are mixed."""
    ref, out = sc.ref, list[Array]()
    j = int(np.clip(np.searchsorted(d.tp, s[0]), 1, len(d.tp) - 1))
    f = (s[0] - d.tp[j - 1]) / (d.tp[j] - d.tp[j - 1])
    err = d.poses[j - 1 : j + 1] - np.stack(reported(d, d.way, d.tp[j - 1 : j + 1], sc.causes), 1)
    e, white = (1 - f) * err[0] + f * err[1], (1 - f) ** 2 + f * f
    psd = np.sqrt([ref.sd**2 * white + ref.slow**2] * 2 + [ref.sd_h**2 * white + ref.slow_h**2])
    sides: list[tuple[list[Cause], Where]] = [
        ([], lambda t: reported(d, d.way, t, sc.causes)),
        (sc.causes, d.way.at),
    ]
    for causes, where in sides:
        means = []
        for _ in range(30):
            q = e - psd * rng.standard_normal(3)
            rd = readings(las, sc.room, causes, _moved(where, q), s, laser_ctx(d))
            means.append(clipped(causes, rd)[0])
        extra = _extra(causes) + rd.mixed[0] * rd.jump[0] ** 2 / 4
        out += [np.mean(means, 0), np.sqrt(np.var(means, 0) + rd.sig[0] ** 2 + extra)]
    return out, bool(np.any(rd.mixed))


def _answers(rng: Rng, sc: Scene, d: Drive, name: str, zero: float, queries: Queries) -> str:
    """Return answers.csv."""
    out, las = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"], sc.las
    for i, j in queries[0]:
        t = d.tp[[i, j]]
        sd, val = np.sqrt(np.diag(motion_cov(sc, d.way, t))), motions(d.poses[[i, j]])[0]
        base, oracle = (motions(mean_poses(sc, d, causes, t))[0] for causes in ([], sc.causes))
        for a, channel in enumerate(("dx", "dy", "dtheta")):
            numbers = f"{val[a]:.7g},{base[a]:.7g},{sd[a]:.5g},{oracle[a]:.7g},{sd[a]:.5g}"
            out.append(f"{name},{channel},{t[0] + zero:.6f},{t[1] + zero:.6f},,{numbers}")
    for k in queries[1] if las else []:
        assert las
        (m0, s0, m1, s1), mixed = _expected(rng, sc, las, d, d.ts[k : k + 1])
        edge, wide = abs(m0 - np.roll(m0, 1)) > 0.08 + 0.03 * m0, 3 + 2 * int(0.03 / las.increment)
        fit = (np.convolve(edge, np.ones(wide), "same") < 0.5) | mixed  # edges are anyone's guess
        fit &= (np.maximum(m0 + 4 * s0, m1 + 4 * s1) < las.far) & (m0 > 2 * las.near) & np.isfinite(d.scans[k])
        stamp = f"{d.ts[k] + zero:.6f}"
        for b in np.flatnonzero(fit):
            numbers = f"{d.scans[k][b]:.4f},{m0[b]:.5f},{s0[b]:.5f},{m1[b]:.5f},{s1[b]:.5f}"
            out.append(f"{name},range,{stamp},{stamp},{b},{numbers}")
    return "\n".join(out) + "\n"


def _setting(rng: Rng, sc: Scene, names: list[str], wrong: str) -> Texts:
    """Return meta.yaml, model.yaml and the map."""
    a, ref = sc.las, sc.ref
    meta = ["model: model.yaml", f"train: [{', '.join(names[:-1])}]", f"test: [{names[-1]}]", f"robot: {sc.robot.meta}"]
    if rng.random() < 0.5:
        sd, sd_h = np.hypot(ref.sd, ref.slow), np.hypot(ref.sd_h, ref.slow_h)
        meta.append(f"truth: {{position_sd: {sd:.4f}, heading_sd: {sd_h:.4f}}}")
    text = {"model.yaml": _model(sc)}
    if a:
        place = f"x: {a.mount[0]}, y: {a.mount[1]}, yaw: {a.mount[2]}, angle_min: {a.angle_min}"
        fan = f"angle_increment: {a.increment}, beams: {a.beams}, time_increment: {a.tinc}"
        meta += ["world: room.world", f"laser: {{{place}, {fan}}}"]
        room = draw_room(rng, a.far) if wrong == "another map" else sc.room
        text["room.world"] = (room.mirrored() if wrong == "mirrored map" else room).world()
    return text | {"meta.yaml": "\n".join(meta) + "\n"}


def _twisted(poses: Array, wrong: str) -> Array:
    """Return poses as they are written."""
    factors = {"poses in mm": (1000, 1000, 1), "y mirrored": (1, -1, 1), "clockwise headings": (1, 1, -1)}
    p = poses[:, [1, 0, 2]] if wrong == "swapped axes" else poses * factors.get(wrong, 1)
    p[:, 2] = np.remainder(p[:, 2] + np.pi, 2 * np.pi) - np.pi
    return np.asarray(p * (1, 1, 180 / np.pi) if wrong == "degrees" else p)


def _commands(sc: Scene, com: Array) -> Texts:
    if sc.robot.kind != "chair":
        return {"command.csv": _table("t,v,w", com, "%.6f,%.4f,%.4f")}
    t, v, w = com.T
    cols = np.transpose([t, to_volts(v, FWD), to_volts(w, LAWS[sc.robot.law]), v, w])
    return {"voltage.csv": _table("t,v_f,v_s,v,w", cols, "%.6f,%.6f,%.6f,%.4f,%.4f")}


def _drive(sc: Scene, d: Drive, poses: Array, t0: float, queries: Queries, wrong: str) -> Texts:
    """Return the files of a drive but for its column and what is asked."""
    k, late = 1000.0 if wrong == "stamps in ms" else 1.0, 4.0 if wrong == "a clock seconds off" else 0.0
    gone = np.zeros(len(d.tp), bool)
    for p, q in queries[0]:
        gone[p + 1 : q + 1] = True
    text = _commands(sc, (d.rows + np.array([t0, 0, 0])) * (k, -1 if wrong == "speed reversed" else 1, 1))
    rows = np.column_stack([(d.tp + t0 + late) * k, _twisted(poses, wrong)])[~gone]
    text["pose.csv"] = _table("t,x,y,theta", rows, "%.6f,%.6f,%.6f,%.6f")
    if sc.las:
        z = {"ranges in mm": d.scans * 1000, "mirrored fan": d.scans[:, ::-1]}.get(wrong, d.scans)
        left = np.setdiff1d(np.arange(len(d.ts)), queries[1])
        head = "t," + ",".join(f"r{b}" for b in range(sc.las.beams))
        text["scan.csv"] = _table(head, np.column_stack([(d.ts + t0) * k, z])[left], "%.6f" + ",%.3f" * sc.las.beams)
    return text


def _column(rng: Rng, d: Drive, t0: float, k: float) -> str:
    s = np.arange(0, d.n * DT, 1.0)
    c = np.transpose([d.ctx[q][(s / DT).astype(int)] for q in ("humidity", "temperature")])
    rows = np.column_stack([(s + t0) * k, c + 0.05 * rng.standard_normal((len(s), 2))])
    return _table("t,humidity,temperature", rows, "%.6f,%.3f,%.3f")


def write(folder: Path, rng: Rng, sc: Scene, truth: dict[str, Any], wrong: str) -> None:
    """Write all files at once."""
    names = [f"run_{i + 1}" for i in range(len(sc.drives))]
    text = _setting(rng, sc, names, wrong)
    zero = float(rng.choice([0.0, 1.6e9 + rng.integers(100_000_000)]))
    extra = rng.random() < 0.4 or "humidity" in str(truth["unknown"]) or any("temperature" in c.id for c in sc.causes)
    drives = [sc.drives[0], *sc.drives[:1], *sc.drives[2:]] if wrong == "a drive given twice" else sc.drives
    for i, (n, d) in enumerate(zip(names, drives, strict=True)):
        t0, test = zero + i * 400.0 * (zero > 0), i == len(names) - 1
        queries: Queries = _queries(rng, d) if test else ([], [])
        poses = d.poses.copy()
        if wrong == "poses of another drive":
            other = sc.drives[(i + 1) % len(names)].poses
            poses[: len(other)] = other[: len(poses)]
        text |= {f"{n}/{file}": table for file, table in _drive(sc, d, poses, t0, queries, wrong).items()}
        if extra:
            text[f"{n}/covariate.csv"] = _column(rng, d, t0, 1000.0 if wrong == "stamps in ms" else 1.0)
        if test:
            ask = [(d.tp[p] + t0, d.tp[q] + t0) for p, q in queries[0]] + [(d.ts[q] + t0,) * 2 for q in queries[1]]
            text[f"{n}/query.csv"] = _table("t0,t1", np.array(ask), "%.6f,%.6f")
            answers = _answers(rng, sc, d, n, t0, queries)
    files = {f"recording/{name}": t for name, t in text.items()} | {"answers.csv": answers}
    for name, t in (files | {"truth.json": json.dumps(truth, indent=1) + "\n"}).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(t)
