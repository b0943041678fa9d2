# SPDX-License-Identifier: BSD-3-Clause
"""The recording's files, its queries and their answers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.knoll.answers import HEAD, Asked, ask, motion_answers, scan_answers
from kurumaisu.bench.strangers.knoll.room import draw_room
from kurumaisu.bench.strangers.knoll.signals import volts
from kurumaisu.bench.strangers.knoll.things import DT, Cause, Drive, Fan, Rng, Scene
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

Texts = dict[str, str]

_OFF = 3.7  # [s] of a clock that is wrong
_WHEELS = {"burger": (0.033, 0.16), "pioneer": (0.0975, 0.38), "agv": (0.08, 0.5), "vacuum": (0.035, 0.23)}


def _laser(fan: Fan) -> str:
    x, y, yaw = fan.mount.tolist()
    return f"""laser:   # {fan.name}
  frame: laser
  mount: {{x: {x}, y: {y}, z: {fan.height}, yaw: {yaw}}}
  angle_min: {fan.angle_min:.9g}
  angle_increment: {fan.increment:.9g}
  beams: {fan.beams}
  scan_time: {fan.scan_time}
  time_increment: {fan.time_increment:.9g}
  error:
    scale: {fan.scale}
    datum_offset: {fan.datum}
    sigma: [{", ".join(f"{s:.6f}" for s in fan.sigma)}]
    resolution: {fan.resolution}
    range_min: {float(fan.near)}
    range_max: {float(fan.far)}
"""


def _model(sc: Scene) -> str:
    """Return model.yaml: the wheelchair's, with this robot's law and laser."""
    text = shipped("launch/md100.yaml").read_text(encoding="utf-8")
    text = re.sub(r"voltage_law: \w+", f"voltage_law: {sc.law}", text, count=1)
    if not sc.robot.startswith("chair"):
        text = text.replace("name: MD-100", f"name: {sc.robot}")
    return re.sub(r"laser:   .*?(?=\n# Effects)", _laser(sc.fan), text, flags=re.DOTALL) if sc.fan else text


def _table(head: str, rows: Iterable[Sequence[object]]) -> str:
    return "\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n"


def _setting(rng: Rng, sc: Scene, names: list[str], wrong: str) -> Texts:
    """Return meta.yaml, model.yaml and the map."""
    out, meta = {"model.yaml": _model(sc)}, ["model: model.yaml"]
    if sc.fan:
        other = draw_room(np.random.default_rng(int(rng.integers(1 << 30))), sc.fan.small)
        out["room.world"] = (other if wrong == "other_map" else sc.room).world(wrong == "mirrored_map")
        meta.append("world: room.world")
    meta += [f"train: [{', '.join(names[:-1])}]", f"test: [{names[-1]}]"]
    if sc.voltage:
        meta.append("robot: md100")
    elif sc.robot in _WHEELS and rng.random() < 0.5:
        radius, track = _WHEELS[sc.robot]
        meta.append(f"robot: {{kind: diff_drive, radius: {radius}, track: {track}}}")
    else:
        meta.append("robot: velocity")
    if rng.random() < 0.5:
        meta.append(f"truth: {{position_sd: {sc.ref.white_p:.4f}, heading_sd: {sc.ref.white_h:.4f}}}")
    return out | {"meta.yaml": "\n".join(meta) + "\n"}


def _twisted(poses: FloatArray, wrong: str, wrapped: bool) -> FloatArray:
    """Return poses as they are written."""
    x, y, th = poses
    if wrapped or wrong == "degrees":
        th = (th + np.pi) % (2 * np.pi) - np.pi
    if wrong == "pose_mm":
        x, y = x * 1000, y * 1000
    elif wrong == "degrees":
        th = np.degrees(th)
    elif wrong == "swap_xy":
        x, y = y, x
    elif wrong == "clockwise":
        th = -th
    return np.stack([x, y, th], 1)


class _Run:
    """The files of one drive: what is asked of the test drive is left out."""

    def __init__(self, sc: Scene, x: Drive, wrong: str, epoch: float, asked: Asked | None) -> None:
        self.sc, self.x, self.wrong, self.epoch, self.asked = sc, x, wrong, epoch, asked

    def stamp(self, t: float) -> str:
        return f"{(t + (self.epoch + self.x.day)) * (1000.0 if self.wrong == 'stamps_ms' else 1.0):.6f}"

    def pose_stamp(self, row: int) -> str:
        return self.stamp(self.x.rt[row] + (_OFF if self.wrong == "clock_off" else 0.0))

    def command(self) -> Texts:
        sign_v, sign_w = (-1 if self.wrong == name else 1 for name in ("sign_v", "sign_w"))
        rows = [(self.stamp(i * DT), sign_v * v, sign_w * w) for i, v, w in self.x.rows]
        if not self.sc.voltage:
            return {"command.csv": _table("t,v,w", rows)}
        f, s = volts(self.sc.law, np.array([v for _, v, _ in rows]), np.array([w for *_, w in rows]))
        both = [(r[0], f"{a:.6f}", f"{b:.6f}", *r[1:]) for r, a, b in zip(rows, f, s, strict=True)]
        return {"voltage.csv": _table("t,v_f,v_s,v,w", both)}

    def pose(self, ref: FloatArray) -> Texts:
        poses = _twisted(ref[:, : self.x.rt.size], self.wrong, self.epoch != 0)
        left = [i for i in range(len(poses)) if not (self.asked and self.asked.gone[i])]
        rows = [(self.pose_stamp(i), *(f"{a:.6f}" for a in poses[i])) for i in left]
        return {"pose.csv": _table("t,x,y,theta", rows)}

    def scan(self) -> Texts:
        r = self.x.scans * (1000 if self.wrong == "range_mm" else 1)
        r = np.round(r[:, ::-1] if self.wrong == "mirrored_fan" else r, 6)
        late = _OFF if self.wrong == "scan_clock_off" else 0.0
        left = [i for i in range(len(r)) if not (self.asked and i in self.asked.scans)]
        rows = [(self.stamp(self.x.st[i] + late), *(f"{a:.6g}" for a in r[i])) for i in left]
        return {"scan.csv": _table("t," + ",".join(f"r{i}" for i in range(r.shape[1])), rows)}

    def covariate(self, rng: Rng) -> Texts:
        t = np.arange(0, self.x.n * DT, 1.0) + 0.013
        cols = [f(self.x.day + t) + rng.normal(0, 0.05, t.size) for f in self.sc.covariates.values()]
        rows = [(self.stamp(s), *(f"{c[i]:.3f}" for c in cols)) for i, s in enumerate(t)]
        return {"covariate.csv": _table("t," + ",".join(self.sc.covariates), rows)}

    def answers(self, rng: Rng, causes: Sequence[Cause], asked: Asked, name: str) -> Texts:
        """Return query.csv and answers.csv."""
        query, rows = [], list[Sequence[object]]()
        for (a, b), each in zip(asked.pairs, motion_answers(self.sc, causes, self.x, asked), strict=True):
            query.append((self.pose_stamp(a), self.pose_stamp(b)))
            rows += [(name, channel, *query[-1], "", numbers) for channel, numbers in each]
        for i in asked.scans:
            query.append((self.stamp(self.x.st[i]),) * 2)
            beams = scan_answers(rng, self.sc, causes, self.x, i, asked.gone)
            rows += [(name, "range", *query[-1], beam, numbers) for beam, numbers in beams]
        return {f"recording/{name}/query.csv": _table("t0,t1", query), "answers.csv": _table(HEAD, rows)}


def write(
    folder: Path, rng: Rng, sc: Scene, causes: Sequence[Cause], drives: Sequence[Drive], wrong: str, truth: str
) -> None:
    """Write all files at once."""
    names = [f"run_{k + 1}" for k in range(len(drives))]
    epoch = 1.7e9 + float(rng.integers(0, 10**7)) if rng.random() < 0.4 else float(rng.choice([0.0, 0.0, 100.0]))
    text = {f"recording/{file}": t for file, t in _setting(rng, sc, names, wrong).items()}
    asked = ask(rng, drives[-1], sc.fan is not None)
    for k, (name, x) in enumerate(zip(names, drives, strict=True)):
        if not (wrong == "twice" and k == 1):
            run = _Run(sc, x, wrong, epoch, asked if k == len(drives) - 1 else None)
            files = run.command() | run.pose(drives[(k + 1) % len(drives) if wrong == "other_poses" else k].ref)
            files |= run.scan() if sc.fan else {}
            files |= run.covariate(rng) if sc.covariates else {}
        text |= {f"recording/{name}/{file}": t for file, t in files.items()}
    text |= run.answers(rng, causes, asked, names[-1]) | {"truth.json": truth}
    for file, t in text.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(t)
