# SPDX-License-Identifier: BSD-3-Clause
"""The kinds of cases: what is hidden in a recording, drawn until it is strong enough."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np

from kurumaisu.bench.strangers.quay.base import Drive, Effects
from kurumaisu.bench.strangers.quay.causes import ALL, PLAIN, VOLTS, draw, draw_unknown, told
from kurumaisu.bench.strangers.quay.driving import MANNERS, make_drive, measure, scan_times
from kurumaisu.bench.strangers.quay.reading import Sure, read
from kurumaisu.bench.strangers.quay.scans import look, means
from kurumaisu.bench.strangers.quay.score import NEED, Judge
from kurumaisu.bench.strangers.quay.things import Rng, Scene, draw_laser, draw_reference, draw_robot, draw_room
from kurumaisu.bench.strangers.quay.writing import answers, ask, setting, tables, write
from kurumaisu.bench.strangers.quay.wrong import spoil

BESIDE = {"single": 6, "form": 6, "pair": 4, "triple": 4, "unknown": 3, "confounded": 0}
KINDS = ("null", "wrong", *BESIDE)
NEUTRAL = ["base.process_noise", "laser.heavy_tails", "laser.dropout"]
CONFOUNDED = (
    ("base.gain_v", "one speed"),
    ("base.curvature_v", "one speed"),
    ("base.gain_w", "one side"),
    ("base.left_right_gain", "one side"),
    ("base.gain_w", "one speed"),
    ("base.curvature_w", "one speed"),
)
CLASH = (  # of each of these sets there is one at most in a pair or a triple
    {"base.gain_v", "base.payload", "base.curvature_v", "base.sign", "base.saturation"},
    {"base.gain_w", "base.payload", "base.curvature_w", "base.sign", "base.saturation", "base.understeer"},
    {"base.delay", "base.lag_v", "base.lag_w", "base.accel_limit", "base.payload"},
    {"laser.mount_yaw", "base.marker_yaw"},
    {"laser.mount_x", "base.marker_x"},
    {"laser.mount_y", "base.marker_y"},
    {"laser.scale", "laser.quadratic", "world.map_error", "laser.offset"},
)


class Case(NamedTuple):
    """A case before it is written; channel, of: where and over what something unknown acts."""

    scene: Scene
    drives: list[Drive]
    eff: Effects
    z: dict[str, tuple[float, float]]
    channel: str = ""
    of: str = ""
    way: str = ""


def _scene(rng: Rng, names: list[str], kind: str) -> Scene:
    volts = True if VOLTS & set(names) else None
    law = "published" if "base.steering_law" in names else "corrected"
    if volts is None and any(k.startswith("base.") for k in names) and rng.random() < 0.15:
        volts = True
    robot = draw_robot(rng, volts, law)
    if robot.volts and law == "corrected" and rng.random() < 0.2 and kind in ("null", "wrong"):
        robot.law = "published"
    eyes = any(k.startswith(("laser", "world")) for k in names) or kind in ("unknown", "wrong")
    laser = draw_laser(rng) if eyes or rng.random() < 0.65 else None
    room, ref = draw_room(rng, bool(laser and laser.rmax < 5)), draw_reference(rng)
    number, since_1970 = int(rng.integers(3, 5)), rng.random() < 0.4
    unix = 1.7e9 + np.round(rng.uniform(0, 6e7), 3) if since_1970 else np.round(rng.uniform(0, 50), 2)
    hz = float(rng.choice([0.5, 0.7, 1.0]))
    columns = [c for c in ("temperature", "humidity", "battery") if rng.random() < 0.25]
    if "laser.temperature" in names and "temperature" not in columns:
        columns.append("temperature")
    return Scene(robot, laser, room, ref, number, float(unix), hz, columns)


def _names(rng: Rng, kind: str) -> tuple[list[str], str]:
    """Return which causes act, and how one drives."""
    if kind in ("single", "form"):
        return [str(rng.choice([k for k in ALL if kind == "single" or k not in PLAIN]))], ""
    if kind == "confounded":
        name, way = CONFOUNDED[int(rng.integers(len(CONFOUNDED)))]
        return [name], way
    while kind in ("pair", "triple"):
        names = [str(k) for k in rng.choice(ALL, 2 if kind == "pair" else 3, replace=False)]
        if not any(len(c & set(names)) > 1 for c in CLASH) and not {"base.sign", "base.steering_law"} & set(names):
            return names, ""
    return [], ""


def _drives(rng: Rng, scene: Scene, eff: Effects, way: str) -> list[Drive]:
    out, since = list[Drive](), 0.0
    manner = str(rng.choice(MANNERS))
    for i in range(scene.number):
        seconds = float(np.round(rng.uniform(95, 160 if scene.number == 4 else 195), 1))
        own = manner if rng.random() < 0.6 else str(rng.choice(MANNERS))
        out.append(make_drive(rng, f"run_{i + 1}", since, scene, eff, own, way, seconds))
        measure(rng, out[-1], scene, eff)
        if scene.laser:
            scan_times(rng, out[-1], scene.hz)
        since = round(since + seconds + float(rng.uniform(20, 90)), 2)
    return out


def _scan(rng: Rng, scene: Scene, drives: list[Drive], eff: Effects) -> Sure:
    """Read all scans; return how sure causes of scatter are by the training drives."""
    total = Sure()
    for dr in drives if scene.laser else []:
        clean = means({}, look(dr, scene, {}, dr.scan_t))
        dr.scan, sure = read(rng, eff, look(dr, scene, eff, dr.scan_t), clean)
        if dr is not drives[-1]:
            for k, (z2, b2) in sure.items():
                a = total.get(k, (0.0, 0.0))
                total[k] = (a[0] + z2, a[1] + b2)
    return total


def _case(rng: Rng, kind: str, seed: int) -> Case:
    for k in range(30):
        scale, channel, of = 1.35 ** (k % 5), "", ""
        if k % 5 == 0:
            names, way = _names(rng, kind)
            scene = _scene(rng, names, kind)
        form = kind == "form" or (kind in ("pair", "triple") and rng.random() < 0.3)
        eff: Effects = {n: draw(n, rng, scale, form, scene) for n in names}
        if kind == "unknown":
            if k % 5 == 0:
                state = rng.bit_generator.state
            keep = rng.bit_generator.state
            rng.bit_generator.state = state  # the same five times, but for its size
            channel, of, key, p = draw_unknown(rng, scale)
            rng.bit_generator.state = keep
            rng.random(7)
            eff = {key: p}
            if of == "humidity" and of not in scene.columns:
                scene.columns.append(of)
        drives = _drives(rng, scene, eff, way)
        sure = _scan(rng, scene, drives, eff)
        if kind in ("null", "wrong"):
            return Case(scene, drives, eff, {})
        z = Judge(drives[:-1], scene).judge(eff, sure, rng)
        most = 4.0 if kind == "confounded" else np.inf
        if set(z) == set(eff) and all(a >= NEED and BESIDE[kind] <= b < most for a, b in z.values()):
            return Case(scene, drives, eff, z, channel, of, way)
    raise RuntimeError(f"{kind} {seed}: no draw was strong enough, the last of {names or channel}")


def _truth(case: Case, kind: str, wrong: str | None) -> dict[str, Any]:
    """Return truth.json."""
    scene, eff = case.scene, case.eff
    truth: dict[str, Any] = {"kind": kind, "causes": [], "neutral": [k for k in NEUTRAL if k not in eff]}
    truth |= {"unknown": None, "wrong": wrong}
    what = wrong or "nothing is hidden"
    for name, p in eff.items():
        z, beside = (round(x, 2) for x in case.z[name])
        if kind == "unknown":
            part = f" ({('x', 'y', 'heading')[p['part']]})" if "part" in p else ""
            what = f"{case.channel}{part} follows {case.of}"
            truth["unknown"] = {"channel": case.channel, "covariates": [case.of], "z": z, "beside": beside}
        else:
            what = ", ".join(eff) + (f" with {case.way}" if case.way else "")
            form = "other" if p["form"] else "usual"
            cause = {"id": name, "z": z, "beside": beside, "form": form, "parameters": told(name, p)}
            truth["causes"].append(cause)
    laser = scene.laser.name if scene.laser else "no laser"
    truth["sentence"] = f"{scene.robot.name}, {laser}, {scene.ref.name} at {scene.ref.rate:g} Hz: {what}"
    return truth


def make(folder: Path, kind: str, seed: int) -> None:
    """Make one case in a folder; RuntimeError where none is strong enough."""
    if kind not in KINDS:
        raise ValueError(kind)
    rng = np.random.default_rng([crc32(kind.encode()), seed])
    case = _case(rng, kind, seed)
    scene, last = case.scene, case.drives[-1]
    query = ask(rng, last)
    files = setting(scene, case.drives, scene.ref.name == "mocap" and rng.random() < 0.4)
    for dr in case.drives:
        for name, rows in tables(dr, scene.robot, scene.columns, query if dr is last else None).items():
            files[f"{dr.name}/{name}"] = rows
    wrong = spoil(rng, files, [d.name for d in case.drives], bool(scene.laser)) if kind == "wrong" else None
    truth = json.dumps(_truth(case, kind, wrong), indent=1).split("\n")
    written = {f"recording/{name}": rows for name, rows in files.items()}
    write(folder, written | {"truth.json": truth, "answers.csv": answers(last, scene, case.eff, query)})
