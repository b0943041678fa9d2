# SPDX-License-Identifier: BSD-3-Clause
"""The files of a case."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.marl.answers import Query, answers, ask
from kurumaisu.bench.strangers.marl.causes import ALL, Cause
from kurumaisu.bench.strangers.marl.driving import Drive
from kurumaisu.bench.strangers.marl.rates import AHEAD, LAWS, to_volts
from kurumaisu.bench.strangers.marl.rooms import draw_room
from kurumaisu.bench.strangers.marl.scans import read_scans
from kurumaisu.bench.strangers.marl.setting import Case, Setting
from kurumaisu.bench.strangers.marl.things import RESOLUTION, Laser, Rng
from kurumaisu.bench.strangers.marl.wrong import COMMANDS, POSES, RANGES, WRONG, same
from kurumaisu.params import shipped
from kurumaisu.types import BoolArray, FloatArray

Texts = dict[str, str]
COLUMNS = ("temperature", "humidity", "tyre", "battery")


def _table(head: str, rows: FloatArray, form: str) -> str:
    return head + "\n" + "".join(form % tuple(r) + "\n" for r in rows)


def _laser_text(las: Laser) -> str:
    kind = las.kind
    return f"""laser:
  frame: laser
  mount: {{x: {las.x}, y: {las.y}, z: {las.height}, yaw: {las.yaw}}}
  angle_min: {las.start}
  angle_increment: {las.step}
  beams: {las.beams}
  scan_time: {kind.scan_time}
  time_increment: {las.beam_time:.9f}
  error:
    scale: {kind.scale}
    datum_offset: {kind.datum}
    sigma: [{kind.sigma[0]}, {kind.sigma[1]}, {kind.sigma[2]}]
    resolution: {RESOLUTION}
    range_min: {kind.near}
    range_max: {kind.far}

"""


def _model(s: Setting) -> str:
    """Return model.yaml: the wheelchair's, with this robot's law and laser."""
    text = shipped("launch/md100.yaml").read_text(encoding="utf-8")
    text = text.replace("voltage_law: published ", f"voltage_law: {s.law} ")
    text = text.replace("name: MD-100", f"name: {s.robot.name}")
    if s.laser:
        a, b = text.index("laser:  "), text.index("# Effects beyond")
        text = text[:a] + _laser_text(s.laser) + text[b:]
    return text


def _world(rng: Rng, s: Setting, wrong: str | None) -> str:
    if wrong == "another map":
        return draw_room(rng, s.reach, s.robot.radius).moved_to(s.room).text()
    return (s.room.mirrored() if wrong == "map mirrored" else s.room).text()


def _setting(rng: Rng, s: Setting, names: list[str], wrong: str | None) -> Texts:
    """Return model.yaml, the map and meta.yaml."""
    r, las, out = s.robot, s.laser, {"model.yaml": _model(s)}
    robot = "md100" if r.chair else "velocity"
    if not r.chair and rng.random() < 0.25:
        robot = f"{{kind: diff_drive, radius: {r.radius / 3:.3f}, track: {r.radius * 1.4:.3f}}}"
    meta = ["model: model.yaml", f"robot: {robot}"]
    if las:
        out["room.world"] = _world(rng, s, wrong)
        fan = f"angle_min: {las.start}, angle_increment: {las.step}, beams: {las.beams}"
        meta += ["world: room.world", f"laser: {{x: {las.x}, y: {las.y}, yaw: {las.yaw}, {fan}}}"]
    if rng.random() < 0.4:
        meta.append(f"truth: {{position_sd: {s.ref.white[0]}, heading_sd: {s.ref.white[1]}}}")
    meta += [f"train: [{', '.join(names[:-1])}]", f"test: [{names[-1]}]"]
    return out | {"meta.yaml": "\n".join(meta) + "\n"}


def _commands(s: Setting, rows: FloatArray, wrong: str) -> Texts:
    rows = COMMANDS.get(wrong, same)(rows)
    if not s.voltage:
        return {"command.csv": _table("t,v,w", rows, "%.6f,%.5f,%.5f")}
    t, v, w = rows.T
    volts = np.transpose([t, to_volts(v, AHEAD), to_volts(w, LAWS[s.law]), v, w])
    return {"voltage.csv": _table("t,v_f,v_s,v,w", volts, "%.6f,%.6f,%.6f,%.5f,%.5f")}


def _strays(rng: Rng, d: Drive, poses: FloatArray) -> None:
    """Put a few poses elsewhere, none that a scan has."""
    g = np.setdiff1d(np.flatnonzero(rng.random(len(d.tp)) < 0.002), d.scan_rows)
    poses[:2, g] += rng.normal(0, 0.5, (2, len(g)))


def _kept(d: Drive, query: Query) -> tuple[BoolArray, BoolArray]:
    """Return which poses and scans are told."""
    poses, scans = np.ones(len(d.tp), bool), np.ones(len(d.ts), bool)
    for a, b in query.motions:
        poses[a + 1 : b + 1] = False
        scans &= ~((d.scan_rows > a) & (d.scan_rows <= b))
    scans[query.scans] = False
    return poses, scans


def _pose_table(s: Setting, t: FloatArray, poses: FloatArray, keep: BoolArray, wrong: str) -> str:
    rows = POSES.get(wrong, same)(np.column_stack([t, poses.T]))
    if s.wrapped and wrong != "headings in degrees":
        rows[:, 3] = (rows[:, 3] + np.pi) % (2 * np.pi) - np.pi
    return _table("t,x,y,theta", rows[keep], "%.6f,%.5f,%.5f,%.6f")


def _scan_table(t: FloatArray, ranges: FloatArray, keep: BoolArray, wrong: str) -> str:
    rows, n = np.column_stack([t, RANGES.get(wrong, same)(ranges)]), ranges.shape[1]
    return _table("t," + ",".join(f"r{i}" for i in range(n)), rows[keep], "%.6f" + ",%.4f" * n)


def _covariates(d: Drive, zero: float, columns: list[str]) -> str:
    t = np.arange(0, d.duration, 0.5)
    rows = np.transpose([t + zero, *(d.covariates[k](t) for k in columns)])
    return _table(",".join(["t", *columns]), rows, "%.3f" + ",%.4f" * len(columns))


def _query(d: Drive, zero: float, query: Query) -> str:
    asked = [(d.tp[a], d.tp[b]) for a, b in query.motions] + [(d.ts[i], d.ts[i]) for i in query.scans]
    return _table("t0,t1", np.array(asked) + zero, "%.6f,%.6f")


def _columns(s: Setting, causes: Sequence[Cause]) -> list[str]:
    """Return the covariates that are told."""
    needed = {c.of for c in causes} | {"temperature" for c in causes if c.id == "laser.temperature"}
    return [k for k in COLUMNS if s.columns or k in needed]


def _drives(rng: Rng, case: Case, zeros: list[float], scans: list[FloatArray], query: Query, wrong: str) -> list[Texts]:
    """Return the files of each drive."""
    s, drives, columns, out = case.setting, case.drives, _columns(case.setting, case.causes), list[Texts]()
    late = rng.uniform(3, 8)
    for i, d in enumerate(drives):
        test = d is drives[-1]
        k = 0 if wrong == "a drive given twice" and i == 1 else i
        told, zero = drives[k], zeros[k]
        text = _commands(s, told.rows + np.array([zero, 0, 0]), wrong)
        keep, scan_keep = _kept(told, query if test else Query([], []))
        poses = told.poses.copy()
        if wrong == "poses of another drive" and i == 0:
            poses = np.array([np.interp(told.tp, drives[1].tp, x) for x in drives[1].poses])
        if not test:
            _strays(rng, told, poses)
        stamps = told.tp + zero + (late if wrong == "the clock of poses some seconds off" else 0)
        text["pose.csv"] = _pose_table(s, stamps, poses, keep, wrong)
        if s.laser:
            text["scan.csv"] = _scan_table(told.ts + zero, scans[k], scan_keep, wrong)
        if columns:
            text["covariate.csv"] = _covariates(d, zeros[i], columns)
        if test:
            text["query.csv"] = _query(d, zero, query)
        out.append(text)
    return out


def _parameters(c: Cause) -> dict[str, float]:
    """Return the parameters of a cause in its usual form that have a name."""
    name, out = ALL[c.id].parameter, dict[str, float]()
    if c.other:
        return out
    if name:
        out[name] = round(float(c.size), 6)
    for cause, own in (("base.payload", "tau"), ("laser.cyclic", "wavelength")):
        if c.id == cause:
            out[own] = round(float(c.own[own]), 4)
    return out


def _hidden(case: Case, wrong: str | None) -> str:
    """Return in words what is hidden, and how the drives are limited."""
    limit = {"one_speed": ", driven at one speed only", "left": ", turning to the left only"}
    if wrong:
        return f"wrong data: {wrong}"
    if not case.causes:
        return "nothing is hidden"
    said = [f"{c.channel} follows {c.of}" if c.channel else f"{c.id} {c.size:.4g}" for c in case.causes]
    return " and ".join(said) + limit.get(case.setting.limit, "")


def _truth(case: Case, wrong: str | None) -> str:
    """Return truth.json."""
    s, ids = case.setting, [c.id for c in case.causes]
    neutral = ["base.process_noise"] + ["laser.heavy_tails"] * bool(s.laser and s.tails > 0)
    causes, unknown = list[dict[str, Any]](), None
    for c, shown in zip(case.causes, case.shown, strict=True):
        sure = {"z": round(shown[0], 2), "beside": round(shown[1], 2)}
        if c.channel:
            unknown = {"channel": c.channel, "covariates": [c.of], **sure}
        else:
            form = "other" if c.other else "usual"
            causes.append({"id": c.id, **sure, "form": form, "parameters": _parameters(c)})
    laser = s.laser.kind.name if s.laser else "no laser"
    place = f"{s.robot.name} {s.style}, {laser}, {s.ref.name}, {len(s.room.boxes)} walls"
    out = {"kind": case.kind, "causes": causes, "neutral": [k for k in neutral if k not in ids], "unknown": unknown}
    return json.dumps(out | {"wrong": wrong, "sentence": f"{_hidden(case, wrong)}; {place}"}, indent=1)


def write(folder: Path, rng: Rng, case: Case) -> None:
    """Write all files of a case."""
    wrong = WRONG[rng.integers(len(WRONG))] if case.kind == "wrong" else None
    s, drives = case.setting, case.drives
    scans = [read_scans(rng, d, s.room, case.causes) if s.laser else np.zeros((0, 0)) for d in drives]
    query = ask(rng, drives[-1])
    names = [f"drive_{i + 1}" for i in range(len(drives))]
    zeros = [s.epoch + round(d.start - drives[0].start, 3) for d in drives]
    told = answers(rng, case, names[-1], zeros[-1], scans[-1], query)
    files = {f"recording/{name}": text for name, text in _setting(rng, s, names, wrong).items()}
    for name, texts in zip(names, _drives(rng, case, zeros, scans, query, wrong or ""), strict=True):
        files |= {f"recording/{name}/{file}": text for file, text in texts.items()}
    for name, text in (files | {"answers.csv": told, "truth.json": _truth(case, wrong)}).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
