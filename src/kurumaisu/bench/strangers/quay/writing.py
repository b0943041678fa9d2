# SPDX-License-Identifier: BSD-3-Clause
"""Queries, answers, and the files of a recording."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.quay.base import (
    DT,
    Drive,
    Effects,
    growth,
    mean_path,
    motion_cov,
    rates,
    refer,
    relative,
    to_volts,
)
from kurumaisu.bench.strangers.quay.scans import beam_quantity, means, rays, refers
from kurumaisu.bench.strangers.quay.things import Array, Laser, Reference, Robot, Room, model_text, world_text

Rows = list[str]


def stamp(dr: Drive, t: float) -> str:
    """A time as it is written."""
    return f"{dr.start + t:.6f}"


def ask(rng: np.random.Generator, dr: Drive) -> tuple[list[tuple[int, int]], list[int]]:
    """Pairs of rows of the reference, and scans."""
    pairs, t, last = [], dr.pose_t, 6.0
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
    scans = []
    for s in rng.permutation(len(dr.scan_t)):
        ts = dr.scan_t[s]
        k = int(np.searchsorted(t, ts))
        near = 0 < k < t.size and t[k] - t[k - 1] < 0.7 and not dr.off[max(k - 2, 0) : k + 2].any()
        if near and all(ts < t[i] - 0.8 or ts > t[j] + 1.0 for i, j in pairs) and len(scans) < 9:
            scans.append(int(s))
    return pairs, sorted(scans)


def answers(
    dr: Drive,
    robot: Robot,
    laser: Laser | None,
    room: Room,
    ref: Reference,
    eff: Effects,
    pairs: list[tuple[int, int]],
    scans: list[int],
) -> Rows:
    """Rows of answers.csv: what was measured, and what the model without and with the causes says."""
    out = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    v, _, w = rates(dr, robot, eff, dr.n)
    rest = np.ones(dr.n)
    grow = growth(robot, eff, v, w)
    paths = [(e, mean_path(dr, robot, e), g) for e, g in (({}, rest), (eff, grow))]
    one, two = np.array([0]), np.array([1])
    for i, j in pairs:
        t = dr.pose_t[[i, j]]
        value = relative(dr.pose[[i, j]], one, two)[0]
        res = []
        for e, p, g in paths:
            m = relative(refer(dr, robot, e, p, t), one, two)[0]
            res.append((m, np.sqrt(np.diag(motion_cov(dr, robot, ref, t, g, False)))))
        for k, ch in enumerate(("dx", "dy", "dtheta")):
            nums = [value[k], res[0][0][k], res[0][1][k], res[1][0][k], res[1][1][k]]
            out.append(f"{dr.name},{ch},{stamp(dr, t[0])},{stamp(dr, t[1])},," + ",".join(f"{x:.6g}" for x in nums))
    if laser:
        out += _ranges(dr, robot, laser, room, ref, eff, scans)
    return out


def _ranges(dr: Drive, robot: Robot, laser: Laser, room: Room, ref: Reference, eff: Effects, scans: list[int]) -> Rows:
    out = []
    good = ~dr.off
    sds = (np.hypot(ref.sp, ref.wp), np.hypot(ref.sp, ref.wp), np.hypot(ref.sh, ref.wh))
    truth = refer(dr, robot, eff, dr.path, dr.pose_t)
    err = dr.pose - truth
    for s in scans:
        t = dr.scan_t[s : s + 1]
        e = np.array([np.interp(t[0], dr.pose_t[good], err[good, k]) for k in range(3)])
        cols = []
        for which in ({}, eff):
            mark = refers(eff) and not which
            path = (refer(dr, robot, eff, dr.path, np.arange(dr.n + 1) * DT) if mark else dr.path) + e
            m0 = None
            var: Any = 0
            for k, sd in [(0, 0.0), *[(k, sg * sds[k]) for k in range(3) for sg in (1, -1)]]:
                p = path.copy()
                p[:, k] += sd
                geo = rays(dr, laser, room, which, t, p)
                m = means(dr, robot, laser, room, which, t, geo)[0]
                if which and (q := eff.get("laser.quantisation")) and q["form"]:
                    m = m - q["step"] / 2
                if m0 is None:
                    m0, var = m, _spread(which, laser, geo, dr, robot, room, t) ** 2
                else:
                    var = var + np.where(np.isfinite(m), m - m0, 0) ** 2 / 2
            cols.append((m0, np.sqrt(var)))
        (bm, bs), (om, os_) = cols
        for b in range(laser.n):
            y = dr.scan[s, b]
            if np.isfinite(y) and max(bm[b], om[b]) < laser.rmax and min(bm[b], om[b]) > laser.rmin:
                a = stamp(dr, t[0])
                out.append(
                    f"{dr.name},range,{a},{a},{b}," + ",".join(f"{x:.6g}" for x in (y, bm[b], bs[b], om[b], os_[b]))
                )
    return out


def _spread(eff: Effects, laser: Laser, geo: Any, dr: Drive, robot: Robot, room: Room, t: Array) -> Array:
    """Sd of a reading with the causes of scatter."""
    r, _, cosi, _ = (x[0] if isinstance(x, np.ndarray) else x for x in geo)
    sd = laser.sd(r)
    if p := eff.get("laser.range_noise"):
        sd = sd * (1 + p["share"] * (0.7 + 0.15 * np.minimum(r, 4) if p["form"] else 1))
    if p := eff.get("laser.incidence_noise"):
        sd = sd * (1 + p["gain"] * np.minimum(1 / cosi - 1 if not p["form"] else np.sqrt(1 - cosi**2) / cosi, 4))
    if p := eff.get("unknown.spread"):
        beta = laser.angle_min + np.arange(laser.n) * laser.inc
        sd = sd * np.exp(p["size"] * p["shape"](beam_quantity(dr, robot, room, p["of"], t, geo, beta))[0])
    if p := eff.get("laser.heavy_tails"):
        sd = sd * (1.46 if p["form"] else 1 / np.sqrt(1 - 2 * p["inverse_nu"]))
    if p := eff.get("laser.common_mode"):
        sd = np.hypot(sd, p["sd"])
    step = eff.get("laser.quantisation", {}).get("step", laser.res)
    return np.sqrt(sd**2 + step**2 / 12)


def tables(
    dr: Drive, robot: Robot, columns: list[str], query: tuple[list[tuple[int, int]], list[int]] | None, eff: Effects
) -> dict[str, Rows]:
    """The files of a drive, as lines of numbers."""
    files: dict[str, Rows] = {}
    v, w = dr.vc[dr.rows], dr.wc[dr.rows]
    t = [stamp(dr, i * DT) for i in dr.rows]
    if robot.volts:
        f, s = to_volts(robot, v, w)
        files["voltage.csv"] = ["t,v_f,v_s,v,w"] + [
            f"{a},{b:.7f},{c:.7f},{d:.4f},{e:.4f}" for a, b, c, d, e in zip(t, f, s, v, w)
        ]
    else:
        files["command.csv"] = ["t,v,w"] + [f"{a},{b:.4f},{c:.4f}" for a, b, c in zip(t, v, w)]
    keep, some = np.ones(dr.pose_t.size, bool), np.ones(len(dr.scan_t), bool)
    if query:
        for i, j in query[0]:
            keep[i + 1 : j + 1] = False
        some[query[1]] = False
        files["query.csv"] = ["t0,t1"] + [f"{stamp(dr, dr.pose_t[i])},{stamp(dr, dr.pose_t[j])}" for i, j in query[0]]
        files["query.csv"] += [f"{stamp(dr, dr.scan_t[k])},{stamp(dr, dr.scan_t[k])}" for k in query[1]]
    th = np.arctan2(np.sin(dr.pose[:, 2]), np.cos(dr.pose[:, 2]))
    files["pose.csv"] = ["t,x,y,theta"] + [
        f"{stamp(dr, dr.pose_t[i])},{dr.pose[i, 0]:.5f},{dr.pose[i, 1]:.5f},{th[i]:.6f}" for i in np.flatnonzero(keep)
    ]
    if dr.scan.size:
        files["scan.csv"] = ["t," + ",".join(f"r{k}" for k in range(dr.scan.shape[1]))]
        files["scan.csv"] += [
            stamp(dr, dr.scan_t[k]) + "," + ",".join(f"{x:.4g}" if x < 1 else f"{x:.3f}" for x in dr.scan[k])
            for k in np.flatnonzero(some)
        ]
    if columns:
        g = dr.cov_t
        files["covariate.csv"] = ["t," + ",".join(columns)] + [
            stamp(dr, g[k]) + "," + ",".join(f"{dr.cov[c][k]:.3f}" for c in columns) for k in range(g.size)
        ]
    return files


def setting(
    robot: Robot, laser: Laser | None, room: Room, ref: Reference, drives: list[Drive], said: bool
) -> dict[str, Rows]:
    """meta.yaml, model.yaml and the map."""
    names = [d.name for d in drives]
    meta = ["model: model.yaml", f"robot: {robot.meta}", f"train: [{', '.join(names[:-1])}]", f"test: [{names[-1]}]"]
    if said:
        meta.append(f"truth: {{position_sd: {ref.sp:.4g}, heading_sd: {ref.sh:.4g}}}")
    files = {"model.yaml": [model_text(robot, laser).rstrip("\n")]}
    if laser:
        meta.append("world: room.world")
        files["room.world"] = [world_text(room, drives[0].pose0).rstrip("\n")]
    return files | {"meta.yaml": meta}


def save(folder: Path, files: dict[str, Rows]) -> None:
    """Write all files, in place of an older recording."""
    shutil.rmtree(folder / "recording", ignore_errors=True)
    for name, rows in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(rows) + "\n")
