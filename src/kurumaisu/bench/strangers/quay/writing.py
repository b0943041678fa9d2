# SPDX-License-Identifier: BSD-3-Clause
"""Queries, answers, and the files of a recording."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.quay.base import DT, Drive, Effects, growth, mean_path, rates, to_volts
from kurumaisu.bench.strangers.quay.reference import elsewhere, motion_cov, refer, relative
from kurumaisu.bench.strangers.quay.scans import look, means, spread
from kurumaisu.bench.strangers.quay.things import Array, Rng, Robot, Scene, model_text, world_text

Rows = list[str]
Query = tuple[list[tuple[int, int]], list[int]]  # pairs of rows of the reference, and scans


def _stamp(dr: Drive, t: float) -> str:
    return f"{dr.start + t:.6f}"


def _numbers(values: Iterable[float]) -> str:
    return ",".join(f"{x:.6g}" for x in values)


def ask(rng: Rng, dr: Drive) -> Query:
    """Choose what is asked for."""
    pairs, scans, t, last = list[tuple[int, int]](), list[int](), dr.pose_t, 6.0
    while len(pairs) < 24:
        i = int(np.searchsorted(t, last + rng.uniform(1.5, 5.0)))
        if i >= t.size:
            break
        j = int(np.searchsorted(t, t[i] + 2.0))
        if j >= t.size - 2:
            break
        last = float(t[j])
        if t[j] - t[i] < 2.6 and not dr.off[i : j + 1].any() and j > i:
            pairs.append((i, j))
    for s in rng.permutation(len(dr.scan_t)).tolist():
        ts = dr.scan_t[s]
        k = int(np.searchsorted(t, ts))
        near = 0 < k < t.size and t[k] - t[k - 1] < 0.7 and not dr.off[max(k - 2, 0) : k + 2].any()
        if near and all(ts < t[i] - 0.8 or ts > t[j] + 1.0 for i, j in pairs) and len(scans) < 9:
            scans.append(s)
    return pairs, sorted(scans)


def answers(dr: Drive, scene: Scene, eff: Effects, query: Query) -> Rows:
    """Return answers.csv: what was measured, and what the model without and with the causes says."""
    out, robot = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"], scene.robot
    v, _, w = rates(dr, robot, eff, dr.n)
    noises = np.ones(dr.n), growth(robot, eff, v, w)
    sides = [(e, mean_path(dr, robot, e), g) for e, g in zip(({}, eff), noises, strict=True)]
    one, two = np.array([0]), np.array([1])
    for i, j in query[0]:
        t = dr.pose_t[[i, j]]
        said = [relative(dr.pose[[i, j]], one, two)[0]]
        for e, path, g in sides:
            said.append(relative(refer(dr, robot, e, path, t), one, two)[0])
            said.append(np.sqrt(np.diag(motion_cov(dr, robot, scene.ref, t, g))))
        for channel, numbers in zip(("dx", "dy", "dtheta"), np.stack(said, 1), strict=True):
            out.append(f"{dr.name},{channel},{_stamp(dr, t[0])},{_stamp(dr, t[1])},,{_numbers(numbers)}")
    return out + (_ranges(dr, scene, eff, query[1]) if scene.laser else [])


def _expected(dr: Drive, scene: Scene, eff: Effects, t: Array, path: Array) -> tuple[Array, Array]:
    """Return mean and sd of a scan's readings at poses on a path that are as sure as the reference."""
    ref = scene.ref
    sds = (np.hypot(ref.sp, ref.wp), np.hypot(ref.sp, ref.wp), np.hypot(ref.sh, ref.wh))
    q = eff.get("laser.quantisation", {"form": False})
    shift = q["step"] / 2 if q["form"] else 0.0
    view = look(dr, scene, eff, t, path)
    mean, var = means(eff, view)[0] - shift, spread(eff, view)[0] ** 2
    for k, sd in ((k, sign * sds[k]) for k in range(3) for sign in (1, -1)):
        p = path.copy()
        p[:, k] += sd
        m = means(eff, look(dr, scene, eff, t, p))[0] - shift
        var = var + np.where(np.isfinite(m), m - mean, 0) ** 2 / 2
    return mean, np.sqrt(var)


def _ranges(dr: Drive, scene: Scene, eff: Effects, scans: list[int]) -> Rows:
    out, laser = Rows(), scene.laser
    assert laser
    err = dr.pose - refer(dr, scene.robot, eff, dr.path, dr.pose_t)
    seen = refer(dr, scene.robot, eff, dr.path, np.arange(dr.n + 1) * DT) if elsewhere(eff) else dr.path
    for s in scans:
        t = dr.scan_t[s : s + 1]
        e = np.array([np.interp(t[0], dr.pose_t[~dr.off], err[~dr.off, k]) for k in range(3)])
        base, base_sd = _expected(dr, scene, {}, t, seen + e)
        oracle, oracle_sd = _expected(dr, scene, eff, t, dr.path + e) if eff else (base, base_sd)
        for b, numbers in enumerate(zip(dr.scan[s], base, base_sd, oracle, oracle_sd, strict=True)):
            low, high = min(base[b], oracle[b]), max(base[b], oracle[b])
            if np.isfinite(numbers[0]) and high < laser.rmax and low > laser.rmin:
                out.append(f"{dr.name},range,{_stamp(dr, t[0])},{_stamp(dr, t[0])},{b},{_numbers(numbers)}")
    return out


def _commands(dr: Drive, robot: Robot) -> dict[str, Rows]:
    v, w, t = dr.vc[dr.rows], dr.wc[dr.rows], [_stamp(dr, i * DT) for i in dr.rows]
    rates = [f"{a:.4f},{b:.4f}" for a, b in zip(v, w, strict=True)]
    if not robot.volts:
        return {"command.csv": ["t,v,w"] + [f"{a},{b}" for a, b in zip(t, rates, strict=True)]}
    rows = zip(t, *to_volts(v, w, robot.law), rates, strict=True)
    return {"voltage.csv": ["t,v_f,v_s,v,w"] + [f"{a},{b:.7f},{c:.7f},{d}" for a, b, c, d in rows]}


def tables(dr: Drive, robot: Robot, columns: list[str], query: Query | None) -> dict[str, Rows]:
    """Return the files of a drive, without what is asked for."""
    files, times, scan_times = _commands(dr, robot), dr.pose_t, dr.scan_t
    keep, some = np.ones(times.size, bool), np.ones(scan_times.size, bool)
    if query:
        for i, j in query[0]:
            keep[i + 1 : j + 1] = False
        some[query[1]] = False
        asked = [(times[i], times[j]) for i, j in query[0]] + [(scan_times[k],) * 2 for k in query[1]]
        files["query.csv"] = ["t0,t1"] + [f"{_stamp(dr, t0)},{_stamp(dr, t1)}" for t0, t1 in asked]
    poses = dr.pose.copy()
    poses[:, 2] = np.arctan2(np.sin(poses[:, 2]), np.cos(poses[:, 2]))
    files["pose.csv"] = ["t,x,y,theta"]
    for i in np.flatnonzero(keep):
        x, y, th = poses[i]
        files["pose.csv"].append(f"{_stamp(dr, times[i])},{x:.5f},{y:.5f},{th:.6f}")
    if dr.scan.size:
        files["scan.csv"] = ["t," + ",".join(f"r{k}" for k in range(dr.scan.shape[1]))]
        for k in np.flatnonzero(some):
            readings = (f"{x:.4g}" if x < 1 else f"{x:.3f}" for x in dr.scan[k])
            files["scan.csv"].append(",".join([_stamp(dr, scan_times[k]), *readings]))
    if columns:
        files["covariate.csv"] = ["t," + ",".join(columns)]
        for k, t in enumerate(dr.cov_t):
            files["covariate.csv"].append(",".join([_stamp(dr, t), *(f"{dr.cov[c][k]:.3f}" for c in columns)]))
    return files


def setting(scene: Scene, drives: list[Drive], said: bool) -> dict[str, Rows]:
    """Return meta.yaml, model.yaml and the map."""
    names, ref = [d.name for d in drives], scene.ref
    meta = ["model: model.yaml", f"robot: {scene.robot.meta}"]
    meta += [f"train: [{', '.join(names[:-1])}]", f"test: [{names[-1]}]"]
    if said:
        meta.append(f"truth: {{position_sd: {ref.sp:.4g}, heading_sd: {ref.sh:.4g}}}")
    files = {"model.yaml": [model_text(scene.robot, scene.laser)]}
    if scene.laser:
        meta.append("world: room.world")
        files["room.world"] = [world_text(scene.room)]
    return files | {"meta.yaml": meta}


def write(folder: Path, files: dict[str, Rows]) -> None:
    """Write all files, in place of an older recording."""
    shutil.rmtree(folder / "recording", ignore_errors=True)
    for name, rows in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(rows) + "\n")
