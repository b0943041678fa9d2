# SPDX-License-Identifier: BSD-3-Clause
"""The kinds of cases: what is hidden in a recording, drawn until it is strong enough."""

import json
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from kurumaisu.bench.strangers.quay.base import Drive, Effects
from kurumaisu.bench.strangers.quay.causes import ALL, PLAIN, VOLTS, draw, draw_unknown, told
from kurumaisu.bench.strangers.quay.driving import MANNERS, make_drive, measure, scan_times
from kurumaisu.bench.strangers.quay.scans import means, rays, read
from kurumaisu.bench.strangers.quay.score import Judge
from kurumaisu.bench.strangers.quay.things import (
    Laser,
    Reference,
    Robot,
    Room,
    draw_laser,
    draw_reference,
    draw_robot,
    draw_room,
)
from kurumaisu.bench.strangers.quay.writing import answers, ask, save, setting, tables
from kurumaisu.bench.strangers.quay.wrong import spoil

KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")
NEUTRAL = ["base.process_noise", "laser.heavy_tails", "laser.dropout"]
NOT_FORM = PLAIN
CONFOUNDED = (
    ("base.gain_v", "one speed"),
    ("base.curvature_v", "one speed"),
    ("base.gain_w", "one side"),
    ("base.left_right_gain", "one side"),
    ("base.gain_w", "one speed"),
    ("base.curvature_w", "one speed"),
)
CLASH = (
    ("base.gain_v", "base.payload", "base.curvature_v", "base.sign", "base.saturation"),
    ("base.gain_w", "base.payload", "base.curvature_w", "base.sign", "base.saturation", "base.understeer"),
    ("base.delay", "base.lag_v", "base.lag_w", "base.accel_limit", "base.payload"),
    ("laser.mount_yaw", "base.marker_yaw"),
    ("laser.mount_x", "base.marker_x"),
    ("laser.mount_y", "base.marker_y"),
    ("laser.scale", "laser.quadratic", "world.map_error", "laser.offset"),
)


class Scene:
    """Robot, laser, room and reference of a case."""

    def __init__(self, rng: np.random.Generator, names: list[str], kind: str) -> None:
        volts = True if any(k in VOLTS for k in names) else None
        law = "published" if "base.steering_law" in names else "corrected"
        if volts is None and any(k.startswith("base.") for k in names) and rng.random() < 0.15:
            volts = True
        self.robot: Robot = draw_robot(rng, volts, law)
        if self.robot.volts and law == "corrected" and rng.random() < 0.2 and kind in ("null", "wrong"):
            self.robot.law = "published"
        eyes = any(k.startswith(("laser", "world")) for k in names) or kind in ("unknown", "wrong")
        self.laser: Laser | None = draw_laser(rng) if eyes or rng.random() < 0.65 else None
        self.room: Room = draw_room(rng, bool(self.laser and self.laser.rmax < 5))
        self.ref: Reference = draw_reference(rng)
        self.number = int(rng.integers(3, 5))
        self.unix = (
            1.7e9 + float(np.round(rng.uniform(0, 6e7), 3))
            if rng.random() < 0.4
            else float(np.round(rng.uniform(0, 50), 2))
        )
        self.hz = float(rng.choice([0.5, 0.7, 1.0]))
        self.columns: list[str] = [c for c in ("temperature", "humidity", "battery") if rng.random() < 0.25]
        if "laser.temperature" in names and "temperature" not in self.columns:
            self.columns.append("temperature")


def _names(rng: np.random.Generator, kind: str, seed: int) -> tuple[list[str], str]:
    """Which causes, and how one drives."""
    if kind in ("single", "form"):
        pool = [k for k in ALL if kind == "single" or k not in NOT_FORM]
        return [str(rng.choice(pool))], ""
    if kind == "confounded":
        name, way = CONFOUNDED[int(rng.integers(len(CONFOUNDED)))]
        return [name], way
    if kind in ("pair", "triple"):
        while True:
            n = [str(k) for k in rng.choice(ALL, 2 if kind == "pair" else 3, replace=False)]
            if not any(sum(k in c for k in n) > 1 for c in CLASH) and not {"base.sign", "base.steering_law"} & set(n):
                return n, ""
    return [], ""


def _drives(rng: np.random.Generator, s: Scene, eff: Effects, way: str) -> list[Drive]:
    out, since = [], 0.0
    manner = str(rng.choice(MANNERS))
    for i in range(s.number):
        seconds = float(np.round(rng.uniform(95, 160 if s.number == 4 else 195), 1))
        m = manner if rng.random() < 0.6 else str(rng.choice(MANNERS))
        dr = make_drive(rng, f"run_{i + 1}", s.unix + since, since, s.robot, s.room, eff, m, way, seconds)
        measure(rng, dr, s.robot, s.ref, eff)
        if s.laser:
            scan_times(rng, dr, s.laser, s.hz)
        out.append(dr)
        since = round(since + seconds + float(rng.uniform(20, 90)), 2)
    return out


def _scan(rng: np.random.Generator, s: Scene, drives: list[Drive], eff: Effects) -> dict[str, tuple[float, float]]:
    """Read all scans; squares of z and beside of causes of scatter over the training drives."""
    total: dict[str, tuple[float, float]] = {}
    for dr in drives:
        assert s.laser
        clean = means(dr, s.robot, s.laser, s.room, {}, dr.scan_t, rays(dr, s.laser, s.room, {}, dr.scan_t))
        dr.scan, sure = read(dr, s.robot, s.laser, s.room, eff, dr.scan_t, rng, clean)
        if dr is not drives[-1]:
            for k, (z2, b2) in sure.items():
                a = total.get(k, (0.0, 0.0))
                total[k] = (a[0] + z2, a[1] + b2)
    return total


def _case(rng: np.random.Generator, kind: str, seed: int) -> tuple[Scene, list[Drive], Effects, dict[str, Any]]:
    names: list[str] = []
    way = channel = of = ""
    for k in range(30):
        scale = 1.35 ** (k % 5)
        if k % 5 == 0:
            names, way = _names(rng, kind, seed)
            s = Scene(rng, names, kind)
        form = kind == "form" or (kind in ("pair", "triple") and rng.random() < 0.3)
        eff: Effects = {n: draw(n, rng, scale, form, s.robot, s.laser, s.room) for n in names}
        if kind == "unknown":
            assert s.laser
            if k % 5 == 0:
                state = rng.bit_generator.state
            keep = rng.bit_generator.state
            rng.bit_generator.state = state
            channel, of, key, p = draw_unknown(rng, scale, s.ref, s.laser)
            rng.bit_generator.state = keep
            rng.random(7)
            eff = {key: p}
            if of == "humidity" and of not in s.columns:
                s.columns.append(of)
        drives = _drives(rng, s, eff, way)
        sure = _scan(rng, s, drives, eff) if s.laser else {}
        if kind in ("null", "wrong"):
            return s, drives, eff, {}
        judge = Judge(drives[:-1], s.robot, s.laser, s.room, s.ref)
        z = judge.judge(eff, sure, rng)
        need = 4 if kind in ("pair", "triple") else 6 if kind in ("single", "form") else 0
        if kind == "unknown":
            need = 3
        most = 4.0 if kind == "confounded" else np.inf
        if set(z) == set(eff) and all(a >= 10 and need <= b < most for a, b in z.values()):
            return s, drives, eff, {"z": z, "channel": channel, "of": of, "way": way}
    raise RuntimeError(f"{kind} {seed}: no draw was strong enough, the last of {names or channel}")


def make(folder: Path, kind: str, seed: int) -> None:
    """Make one case in a folder; RuntimeError where none is strong enough."""
    if kind not in KINDS:
        raise ValueError(kind)
    rng = np.random.default_rng([crc32(kind.encode()), seed])
    s, drives, eff, what = _case(rng, kind, seed)
    last = drives[-1]
    pairs, scans = ask(rng, last)
    said = s.ref.name == "mocap" and rng.random() < 0.4
    lines = answers(last, s.robot, s.laser, s.room, s.ref, eff, pairs, scans)
    files = setting(s.robot, s.laser, s.room, s.ref, drives, said)
    for dr in drives:
        for name, rows in tables(dr, s.robot, s.columns, (pairs, scans) if dr is last else None, eff).items():
            files[f"{dr.name}/{name}"] = rows
    scene = f"{s.robot.name}, {s.laser.name if s.laser else 'no laser'}, {s.ref.name} at {s.ref.rate:g} Hz"
    truth: dict[str, Any] = {
        "kind": kind,
        "causes": [],
        "neutral": NEUTRAL,
        "unknown": None,
        "wrong": None,
        "sentence": f"{scene}: nothing is hidden",
    }
    truth["neutral"] = [k for k in NEUTRAL if k not in eff]
    if kind == "wrong":
        truth["wrong"] = spoil(rng, files, [d.name for d in drives], bool(s.laser))
        truth["sentence"] = f"{scene}: {truth['wrong']}"
    elif kind == "unknown":
        key = next(iter(eff))
        z, b = what["z"][key]
        p = eff[key]
        part = f" ({('x', 'y', 'heading')[p['part']]})" if "part" in p else ""
        truth["unknown"] = {
            "channel": what["channel"],
            "covariates": [what["of"]],
            "z": round(z, 2),
            "beside": round(b, 2),
        }
        truth["sentence"] = f"{scene}: {what['channel']}{part} follows {what['of']}"
    elif eff:
        for n, p in eff.items():
            z, b = what["z"][n]
            truth["causes"].append(
                {
                    "id": n,
                    "z": round(z, 2),
                    "beside": round(b, 2),
                    "form": "other" if p["form"] else "usual",
                    "parameters": told(n, p),
                }
            )
        truth["sentence"] = f"{scene}: {', '.join(eff)}" + (f" with {what['way']}" if what["way"] else "")
    save(
        folder,
        {"recording/" + k: v for k, v in files.items()}
        | {"truth.json": [json.dumps(truth, indent=1)], "answers.csv": lines},
    )
