# SPDX-License-Identifier: BSD-3-Clause
"""The recording's files, its queries and their answers."""

import json
import re
from pathlib import Path
import numpy as np
from kurumaisu.bench.strangers.fell.judge import mean_poses, motion_cov, motions
from kurumaisu.bench.strangers.fell.laser import P0, REACH0, clipped, readings
from kurumaisu.bench.strangers.fell.plant import DT, FWD, LAWS, to_volts
from kurumaisu.bench.strangers.fell.room import Room, draw_room
from kurumaisu.bench.strangers.fell.scene import Drive, Scene, laser_ctx, reported
from kurumaisu.params import shipped


def model_text(sc: Scene) -> str:
    """model.yaml: the wheelchair's, with this robot's law and laser."""
    s, put, a = shipped("launch/md100.yaml").read_text(encoding="utf-8"), {"voltage_law": sc.robot.law}, sc.las
    if a:
        put |= {
            "angle_min": a.angle_min,
            "angle_increment": a.increment,
            "beams": a.beams,
            "scan_time": a.scan_time,
            "time_increment": a.tinc,
            "scale": a.scale,
            "datum_offset": a.datum,
            "sigma": list(a.sigma),
            "range_min": a.near,
            "range_max": a.far,
            "mount": f"{{x: {a.mount[0]}, y: {a.mount[1]}, z: {a.height}, yaw: {a.mount[2]}}}",
        }
    for k, v in put.items():
        s = re.sub(rf"^(\s*{k}:)[^#\n]*", lambda m: f"{m[1]} {v} ", s, count=1, flags=re.M)
    return s


def table(head: str, cols: np.ndarray, fmt: str) -> str:
    """A table as text."""
    return head + "\n" + "".join(fmt % tuple(r) + "\n" for r in cols)


def queries(rng: np.random.Generator, d: Drive) -> tuple[list[tuple[int, int]], list[int]]:
    """Rows of the poses that motions begin and end with, and scans."""
    out, t = [], d.tp[0] + rng.uniform(1, 4)
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


def answers(rng: np.random.Generator, sc: Scene, d: Drive, name: str, zero: float, qs: list, scans: list) -> str:
    """answers.csv."""
    out, las, ref = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"], sc.las, sc.ref
    for i, j in qs:
        t = d.tp[[i, j]]
        sd, val = np.sqrt(np.diag(motion_cov(sc, d.way, t))), motions(d.poses[[i, j]])[0]
        base, oracle = (motions(mean_poses(sc, d, cs, t))[0] for cs in ([], sc.causes))
        for a, ch in enumerate(("dx", "dy", "dtheta")):
            out.append(
                f"{name},{ch},{t[0] + zero:.6f},{t[1] + zero:.6f},,{val[a]:.7g},{base[a]:.7g},{sd[a]:.5g},"
                f"{oracle[a]:.7g},{sd[a]:.5g}"
            )
    for k in scans:
        s, ctx = d.ts[k : k + 1], laser_ctx(d)
        j = int(np.clip(np.searchsorted(d.tp, s[0]), 1, len(d.tp) - 1))
        f = (s[0] - d.tp[j - 1]) / (d.tp[j] - d.tp[j - 1])
        err = d.poses[j - 1 : j + 1] - np.stack(reported(d, d.way, d.tp[j - 1 : j + 1], sc.causes), 1)
        e, white, res = (1 - f) * err[0] + f * err[1], (1 - f) ** 2 + f * f, []
        psd = np.sqrt([ref.sd**2 * white + ref.slow**2] * 2 + [ref.sd_h**2 * white + ref.slow_h**2])
        for cs, truth in (([], lambda t: reported(d, d.way, t, sc.causes)), (sc.causes, d.way.at)):
            mus, extra = [], 1e-7 + P0 * REACH0**2
            for _ in range(30):
                q = e - psd * rng.standard_normal(3)
                rd = readings(las, sc.room, cs, lambda t: [u + v for u, v in zip(truth(t), q)], s, ctx)
                mus.append(clipped(cs, rd)[0])
            for c in cs:
                g = [c.p.get(u, 0) for u in ("sd", "step", "outliers", "reach")]
                extra += {
                    "laser.common_mode": g[0] ** 2,
                    "laser.quantisation": g[1] ** 2 / 12,
                    "laser.heavy_tails": g[2] * g[3] ** 2,
                }.get(c.id, 0.0)
            extra = extra + rd["mixed"][0] * rd["jump"][0] ** 2 / 4
            res += [np.mean(mus, 0), np.sqrt(np.var(mus, 0) + rd["sig"][0] ** 2 + extra)]
        m0, s0, m1, s1 = res
        edge, wide = abs(m0 - np.roll(m0, 1)) > 0.08 + 0.03 * m0, 3 + 2 * int(0.03 / las.increment)
        fit = (np.convolve(edge, np.ones(wide), "same") < 0.5) | np.any(rd["mixed"])  # edges are anyone's guess
        fit &= (np.maximum(m0 + 4 * s0, m1 + 4 * s1) < las.far) & (m0 > 2 * las.near) & np.isfinite(d.scans[k])
        for b, v in enumerate(d.scans[k]):
            if fit[b]:
                t = f"{s[0] + zero:.6f}"
                out.append(f"{name},range,{t},{t},{b},{v:.4f},{m0[b]:.5f},{s0[b]:.5f},{m1[b]:.5f},{s1[b]:.5f}")
    return "\n".join(out) + "\n"


def write(folder: Path, rng: np.random.Generator, sc: Scene, truth: dict, wrong: str) -> None:
    """All files at once."""
    a, ref, names = sc.las, sc.ref, [f"run_{i + 1}" for i in range(len(sc.drives))]
    meta = ["model: model.yaml", f"train: [{', '.join(names[:-1])}]", f"test: [{names[-1]}]", f"robot: {sc.robot.meta}"]
    sd, sd_h, text = np.hypot(ref.sd, ref.slow), np.hypot(ref.sd_h, ref.slow_h), {}
    meta += [f"truth: {{position_sd: {sd:.4f}, heading_sd: {sd_h:.4f}}}"] if rng.random() < 0.5 else []
    if a:
        meta += [
            "world: room.world",
            f"laser: {{x: {a.mount[0]}, y: {a.mount[1]}, yaw: {a.mount[2]}, angle_min: "
            f"{a.angle_min}, angle_increment: {a.increment}, beams: {a.beams}, time_increment: {a.tinc}}}",
        ]
        flip = sc.room.boxes * (-1, 1, -1, 1, 1) + (sc.room.width, 0, 0, 0, 0)
        text["room.world"] = (
            draw_room(rng, a.far)
            if wrong == "another map"
            else Room(sc.room.width, sc.room.height, flip, sc.room.dark)
            if wrong == "mirrored map"
            else sc.room
        ).world()
    zero = float(rng.choice([0.0, 1.6e9 + rng.integers(1e8)]))
    extra = rng.random() < 0.4 or "humidity" in str(truth["unknown"]) or any("temperature" in c.id for c in sc.causes)
    k, late = 1000.0 if wrong == "stamps in ms" else 1.0, 4.0 if wrong == "a clock seconds off" else 0.0
    drives = [sc.drives[0], *sc.drives[:1], *sc.drives[2:]] if wrong == "a drive given twice" else sc.drives
    for i, (n, d) in enumerate(zip(names, drives)):
        t0, test = zero + i * 400.0 * (zero > 0), i == len(names) - 1
        qs, scans = queries(rng, d) if test else ([], [])
        pose, gone = d.poses.copy(), np.zeros(len(d.tp), bool)
        for p, q in qs:
            gone[p + 1 : q + 1] = True
        if wrong == "poses of another drive":
            o = sc.drives[(i + 1) % len(names)].poses
            pose[: len(o)] = o[: len(pose)]
        pose = (
            pose[:, [1, 0, 2]]
            if wrong == "swapped axes"
            else pose
            * {"poses in mm": (1000, 1000, 1), "y mirrored": (1, -1, 1), "clockwise headings": (1, 1, -1)}.get(wrong, 1)
        )
        pose[:, 2] = np.remainder(pose[:, 2] + np.pi, 2 * np.pi) - np.pi
        pose = pose * (1, 1, 180 / np.pi) if wrong == "degrees" else pose
        com = (d.rows + (t0, 0, 0)) * (k, -1 if wrong == "speed reversed" else 1, 1)
        if sc.robot.kind == "chair":
            u = [com[:, 0], to_volts(com[:, 1], FWD), to_volts(com[:, 2], LAWS[sc.robot.law]), com[:, 1], com[:, 2]]
            text[f"{n}/voltage.csv"] = table("t,v_f,v_s,v,w", np.transpose(u), "%.6f,%.6f,%.6f,%.4f,%.4f")
        else:
            text[f"{n}/command.csv"] = table("t,v,w", com, "%.6f,%.4f,%.4f")
        text[f"{n}/pose.csv"] = table(
            "t,x,y,theta", np.column_stack([(d.tp + t0 + late) * k, pose])[~gone], "%.6f,%.6f,%.6f,%.6f"
        )
        if a:
            z = {"ranges in mm": d.scans * 1000, "mirrored fan": d.scans[:, ::-1]}.get(wrong, d.scans)
            left = np.setdiff1d(np.arange(len(d.ts)), scans)
            text[f"{n}/scan.csv"] = table(
                "t," + ",".join(f"r{b}" for b in range(a.beams)),
                np.column_stack([(d.ts + t0) * k, z])[left],
                "%.6f" + ",%.3f" * a.beams,
            )
        if extra:
            s = np.arange(0, d.n * DT, 1.0)
            c = [d.ctx[q][(s / DT).astype(int)] for q in ("humidity", "temperature")]
            c = np.column_stack([(s + t0) * k, np.transpose(c) + 0.05 * rng.standard_normal((len(s), 2))])
            text[f"{n}/covariate.csv"] = table("t,humidity,temperature", c, "%.6f,%.3f,%.3f")
        if test:
            ask = [(d.tp[p] + t0, d.tp[q] + t0) for p, q in qs] + [(d.ts[q] + t0,) * 2 for q in scans]
            text[f"{n}/query.csv"] = table("t0,t1", np.array(ask), "%.6f,%.6f")
            reply = answers(rng, sc, d, n, t0, qs, scans)
    text["meta.yaml"], text["model.yaml"] = "\n".join(meta) + "\n", model_text(sc)
    for f, s in text.items():
        (folder / "recording" / f).parent.mkdir(parents=True, exist_ok=True)
        (folder / "recording" / f).write_text(s)
    (folder / "answers.csv").write_text(reply)
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
