# SPDX-License-Identifier: BSD-3-Clause
"""All files that are written."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.scree.answers import Answer
from kurumaisu.bench.strangers.scree.basics import Array
from kurumaisu.bench.strangers.scree.lasers import HEIGHT, Laser
from kurumaisu.bench.strangers.scree.recorded import Setup, Taken
from kurumaisu.bench.strangers.scree.reference import Reference
from kurumaisu.bench.strangers.scree.robots import CORRECTED, PUBLISHED, SLOPES, Robot, to_volts
from kurumaisu.bench.strangers.scree.rooms import Room


@dataclass(frozen=True)
class Notes:
    """How the owner writes: unit and offset of clocks, how good the reference is called, wrapped headings or not."""

    pose_clock: float = 1.0
    command_late: float = 0.0
    stated: float = 1.0
    wrapped: bool = False


def _table(file: Path, header: str, columns: list[Array], formats: list[str]) -> None:
    lines = [header]
    texts = [[f % x for x in c.tolist()] for f, c in zip(formats, columns, strict=True)]
    lines += [",".join(row) for row in zip(*texts, strict=True)]
    file.write_text("\n".join(lines) + "\n")


def _law(name: str, zeros: tuple[tuple[float, float], tuple[float, float]]) -> str:
    out = f"  {name}:\n"
    for axis, key in enumerate(("translation", "steering")):
        (up, down), (a, b) = SLOPES[axis], zeros[axis]
        out += f"    {key}:\n      positive: {{slope: {up}, intercept: {a}}}\n"
        out += f"      negative: {{slope: {down}, intercept: {b}}}\n"
    return out


def _model(robot: Robot, laser: Laser) -> str:
    s = laser.sigma
    law = "published" if robot.published else "corrected"
    return (
        f"name: {robot.name}\nvoltage_law: {law}\nvoltage_laws:\n"
        + _law("published", PUBLISHED)
        + _law("corrected", CORRECTED)
        + _law("custom", ((0.1, -0.1), CORRECTED[1]))
        + "reference_voltage: 2.5\nvoltages:\n  knob: 1.0\n"
        "  translation: {min: -2.0, max: 2.2, resolution: 0.0}\n"
        "  steering: {min: -1.0, max: 1.0, resolution: 0.0}\n  reference: {min: 0.0, max: 5.0}\n"
        f"chassis:\n  length: 0.6\n  width: {robot.track + 0.06:.3f}\n  height: 1.0\n  axle_to_front: 0.4\n"
        f"  track: {robot.track}\n  mass: 60.0\n"
        f"laser:\n  frame: laser\n  mount: {{x: {laser.mount[0]}, y: {laser.mount[1]}, z: {HEIGHT}, "
        f"yaw: {laser.mount[2]}}}\n  angle_min: {laser.first}\n  angle_increment: {laser.step}\n"
        f"  beams: {laser.beams}\n  scan_time: {laser.turn}\n  time_increment: {laser.between:.10f}\n"
        f"  error:\n    scale: {laser.scale}\n    datum_offset: {laser.datum}\n"
        f"    sigma: [{s[0]}, {s[1]}, {s[2]}]\n    resolution: {laser.resolution}\n"
        f"    range_min: {laser.near}\n    range_max: {laser.far}\neffects: []\n"
    )


def _world(room: Room) -> str:
    out = '# Metres, degrees.\nname "room"\n\ndefine wall model\n(\n  color "gray30"\n)\n\n'
    for b in room.boxes:
        dark = f" ranger_return {b.bright:g}" if b.bright < 1 else ""
        size = f"[{b.length:.4f} {b.width:.4f} 1.0]"
        out += f'wall ( name "{b.name}" pose [{b.x:.4f} {b.y:.4f} 0 {b.turned:g}] size {size}{dark} )\n'
    return out


def _meta(setup: Setup, names: list[str], notes: Notes) -> str:
    r, robot = setup.reference, setup.robot
    place = float(np.hypot(r.place, r.wander)) * notes.stated
    kind = robot.kind
    if kind == "diff_drive":
        kind = f"{{kind: diff_drive, radius: {robot.radius}, track: {robot.track}}}"
    out = f"model: model.yaml\nrobot: {kind}\n"
    if setup.site is not None:
        out += "world: room.world\n"
    out += f"truth: {{position_sd: {place:.5f}, heading_sd: {r.heading * notes.stated:.5f}}}\n"
    return out + f"train: [{', '.join(names[:-1])}]\ntest: [{names[-1]}]\n"


def clock(reference: Reference, taken: Taken, t: Array) -> Array:
    """Stamps as they are written."""
    return np.asarray(np.round(reference.unix + taken.drive.start + t, 6))


def _drive(folder: Path, setup: Setup, taken: Taken, notes: Notes) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rows, poses, ref, robot = taken.drive.rows, taken.poses, setup.reference, setup.robot
    t = clock(ref, taken, rows.t + notes.command_late)
    if robot.volts:
        volts = [to_volts(u, k, robot.published) for k, u in enumerate((rows.v, rows.w))]
        _table(folder / "voltage.csv", "t,v_f,v_s,v,w", [t, *volts, rows.v, rows.w], ["%.6f"] + ["%.6f"] * 4)
    else:
        _table(folder / "command.csv", "t,v,w", [t, rows.v, rows.w], ["%.6f", "%.5f", "%.5f"])
    shown = clock(ref, taken, poses.t) * notes.pose_clock
    x, y, th = poses.pose.T
    if notes.wrapped:
        th = (th + np.pi) % (2 * np.pi) - np.pi
    _table(folder / "pose.csv", "t,x,y,theta", [shown, x, y, th], ["%.6f"] * 4)
    if taken.scans is not None:
        n = taken.scans.r.shape[1]
        columns = [clock(ref, taken, taken.scans.t), *taken.scans.r.T]
        header = "t," + ",".join(f"r{k}" for k in range(n))
        _table(folder / "scan.csv", header, columns, ["%.6f"] + ["%.6g"] * n)
    if setup.noted:
        at = np.arange(0.0, taken.drive.length, 0.8)
        columns = [clock(ref, taken, at)] + [c.at(at + taken.drive.start) for c in setup.columns]
        _table(
            folder / "covariate.csv",
            ",".join(["t"] + [c.name for c in setup.columns]),
            columns,
            ["%.6f"] + ["%.4f"] * len(setup.columns),
        )
    if len(taken.asked):
        q = clock(ref, taken, taken.asked)
        _table(folder / "query.csv", "t0,t1", [q[:, 0], q[:, 1]], ["%.6f", "%.6f"])


def write_recording(folder: Path, setup: Setup, taken: list[Taken], laser: Laser, notes: Notes) -> None:
    """The recording: meta, model, map, drives."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "meta.yaml").write_text(_meta(setup, [t.drive.name for t in taken], notes))
    (folder / "model.yaml").write_text(_model(setup.robot, laser))
    if setup.site is not None:
        (folder / "room.world").write_text(_world(setup.room))
    for t in taken:
        _drive(folder / t.drive.name, setup, t, notes)


def write_answers(file: Path, reference: Reference, taken: Taken, answers: list[Answer]) -> None:
    """The answers to the queries."""
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    for a in answers:
        t0, t1 = clock(reference, taken, np.array([a.t0, a.t1])).tolist()
        beam = "" if a.beam < 0 else str(a.beam)
        numbers = ",".join(f"{x:.7g}" for x in (a.value, *a.base, *a.oracle))
        lines.append(f"{taken.drive.name},{a.channel},{t0:.6f},{t1:.6f},{beam},{numbers}")
    file.write_text("\n".join(lines) + "\n")


def write_truth(file: Path, truth: dict[str, object]) -> None:
    """What is hidden."""
    file.write_text(json.dumps(truth, indent=1) + "\n")
