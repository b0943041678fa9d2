# SPDX-License-Identifier: BSD-3-Clause
"""All files of a case."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.loess.answers import Answer
from kurumaisu.bench.strangers.loess.case import Case
from kurumaisu.bench.strangers.loess.lasers import Laser
from kurumaisu.bench.strangers.loess.recording import Tables
from kurumaisu.bench.strangers.loess.robots import BACK, FORWARD, STEERING
from kurumaisu.bench.strangers.loess.rooms import Box, Room
from kurumaisu.bench.strangers.loess.values import Array

HEAD = "run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"


def _line(ends: tuple[float, float]) -> str:
    return f"{{slope: {ends[0]}, intercept: {ends[1]}}}"


def _laws() -> str:
    lines = ["voltage_laws:"]
    laws = {**STEERING, "custom": STEERING["corrected"]}
    for name, (left, right) in laws.items():
        lines += [
            f"  {name}:",
            "    translation:",
            f"      positive: {_line(FORWARD)}",
            f"      negative: {_line(BACK)}",
        ]
        lines += ["    steering:", f"      positive: {_line(left)}", f"      negative: {_line(right)}"]
    return "\n".join(lines)


def _laser(laser: Laser | None) -> str:
    if laser is None:
        return ""
    x = laser
    return f"""laser:
  frame: laser
  mount: {{x: {x.x}, y: {x.y}, z: 0.40, yaw: {x.yaw}}}
  angle_min: {x.start:.9f}
  angle_increment: {x.increment:.12f}
  beams: {x.beams}
  scan_time: {x.scan_time}
  time_increment: {x.beam_time:.12f}
  error:
    scale: {x.scale}
    datum_offset: {x.offset}
    sigma: [{x.sigma[0]:.7f}, {x.sigma[1]:.7f}, {x.sigma[2]:.7f}]
    resolution: {x.resolution}
    range_min: {x.near}
    range_max: {x.far}
"""


def _model(case: Case, laser: Laser) -> str:
    law = case.robot.law or "corrected"
    return f"""name: {case.robot.name}
voltage_law: {law}
{_laws()}
reference_voltage: 2.5
voltages:
  knob: 1.0
  translation: {{min: -2.6, max: 2.2, resolution: 0.0}}
  steering: {{min: -1.2, max: 1.2, resolution: 0.0}}
  reference: {{min: 0.0, max: 5.0}}
chassis:
  length: 1.00
  width: 0.60
  height: 1.20
  axle_to_front: 0.70
  track: 0.54
  mass: 110.0
{_laser(laser)}effects: []
"""


def _wall(n: int, b: Box) -> str:
    bright = "" if b.bright == 1.0 else f" ranger_return {b.bright:.2f}"
    size = f"size [{b.long:.4f} {b.wide:.4f} 1.0]"
    return f'wall ( name "w{n}" pose [{b.x:.4f} {b.y:.4f} 0 {b.turn:.2f}] {size}{bright} )'


def _world(room: Room) -> str:
    head = f'name "{room.name}"\nsemantics "physical"\ndefine wall model\n(\n  color "gray30"\n  gui_move 0\n)\n'
    return head + "\n".join(_wall(n, b) for n, b in enumerate(room.boxes)) + "\n"


def _meta(case: Case, names: list[str]) -> str:
    place, turn = case.robot.reference.totals()
    robot = "md100" if case.robot.law else "velocity"
    world = "world: room.world\n" if case.laser is not None else ""
    truth = f"truth: {{position_sd: {place:.4f}, heading_sd: {turn:.4f}}}"
    return f"""model: model.yaml
{world}robot: {robot}
{truth}
train: [{", ".join(names[:-1])}]
test: [{names[-1]}]
"""


def _cell(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else ("nan" if np.isnan(value) else "inf")


def _table(path: Path, head: str, rows: Array, digits: int) -> None:
    lines = [head] + [",".join([f"{row[0]:.6f}", *(_cell(v, digits) for v in row[1:])]) for row in rows.tolist()]
    path.write_text("\n".join(lines) + "\n")


def _drive(folder: Path, t: Tables) -> None:
    folder.mkdir(parents=True)
    if t.command.shape[1] == 5:
        _table(folder / "voltage.csv", "t,v_f,v_s,v,w", t.command, 6)
    else:
        _table(folder / "command.csv", "t,v,w", t.command, 4)
    pose = t.pose.copy()
    _table(folder / "pose.csv", "t,x,y,theta", pose, 6)
    if t.scan.size:
        names = ",".join(f"r{i}" for i in range(t.scan.shape[1] - 1))
        _table(folder / "scan.csv", "t," + names, t.scan, 4)
    if t.columns:
        _table(folder / "covariate.csv", ",".join(["t", *t.columns]), t.covariate, 4)
    if t.query.size:
        _table(folder / "query.csv", "t0,t1", t.query, 6)


def _answer(run: str, a: Answer) -> str:
    numbers = ",".join(f"{x:.7f}" for x in (a.value, *a.base, *a.oracle))
    return f"{run},{a.channel},{a.t0:.6f},{a.t1:.6f},{a.beam},{numbers}"


def write_case(folder: Path, case: Case, room: Room, tables: list[Tables], model_laser: Laser) -> None:
    """Write the recording, with the map as its owner has it."""
    recording = folder / "recording"
    recording.mkdir(parents=True)
    (recording / "meta.yaml").write_text(_meta(case, [t.name for t in tables]))
    (recording / "model.yaml").write_text(_model(case, model_laser))
    if case.laser is not None:
        (recording / "room.world").write_text(_world(room))
    for t in tables:
        _drive(recording / t.name, t)


def write_truth(folder: Path, truth: dict[str, object], run: str, answers: list[Answer]) -> None:
    """Write what is hidden, and the answers to the queries."""
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    (folder / "answers.csv").write_text("\n".join([HEAD, *(_answer(run, a) for a in answers)]) + "\n")
