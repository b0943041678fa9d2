# SPDX-License-Identifier: BSD-3-Clause
"""Writes a case: recording, truth, answers."""

import csv
import json
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from kurumaisu.bench.strangers.loch import laser, motion, score
from kurumaisu.bench.strangers.loch.case import Case, draw
from kurumaisu.bench.strangers.loch.laser import MOUNT, readings, shoot
from kurumaisu.bench.strangers.loch.optics import EFFECTS, STORIES
from kurumaisu.bench.strangers.loch.tables import WRONGS, Tables, commands, spoil, write

NAMES = [i for i in EFFECTS if not i.startswith("unknown")]
DULL = [
    ("base.gain_v", "straight"),
    ("base.gain_w", "left"),
    ("base.gain_v", "circle"),
    ("base.curvature_v", "straight"),
    ("base.left_right_gain", "left"),
    ("base.understeer", "circle"),
    ("base.curvature_w", "left"),
    ("base.cross_w_to_v", "circle"),
    ("base.dead_zone_v", "straight"),
    ("base.lateral_slip", "circle"),
    ("base.gain_w", "circle"),
    ("base.dead_zone_w", "spin"),
    ("base.dac_zero_f", "straight"),
    ("base.gain_w", "spin"),
]


def turn(names: Sequence[str], kind: str, seed: int) -> str:
    """Everything has its turn: a permutation for each round of seeds."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed // len(names), 3])
    return names[int(rng.permutation(len(names))[seed % len(names)])]


def _ids(kind: str, seed: int, rng: np.random.Generator) -> list[str]:
    """What is hidden in this case."""
    if kind in ("null", "wrong"):
        return []
    if kind == "confounded":
        return [DULL[seed % len(DULL)][0]]
    names = [n for n in NAMES if n not in ("laser.beam_correlation", "base.steering_law")] if kind == "form" else NAMES
    out = [turn(list(STORIES) if kind == "unknown" else names, kind, seed)]
    pool = [n for n in NAMES if n not in ("base.steering_law", "base.process_noise", *out)]
    return out + [str(a) for a in rng.choice(pool, {"pair": 1, "triple": 2}.get(kind, 0), replace=False)]


def prepare(kind: str, seed: int, need: str) -> Case:
    """Draws cases until one can be told as it should."""
    for attempt in range(12):
        key = [zlib.crc32(kind.encode()), seed, attempt]
        c = draw(
            _ids(kind, seed, np.random.default_rng(key)),
            int(kind == "form"),
            key,
            need,
            DULL[seed % len(DULL)][1] if kind == "confounded" else "",
        )
        least = 4 if kind in ("pair", "triple") else 6
        if c.stage() and (c.rivals if c.dull else all(b >= least for b in c.beside.values())):
            return c
    raise RuntimeError(f"{kind} {seed}: no case that can be told")


def _truth(c: Case, kind: str, sentence: str) -> dict[str, object]:
    """What is hidden, for whoever compares."""
    causes, unknown, said = [], None, []
    for h in c.hidden:
        e, marks = EFFECTS[h.id], {"z": round(c.z[h.id], 2), "beside": round(c.beside[h.id], 2)}
        said.append(f"{h.id}{' in the other form' if h.form else ''}, {h.size:.4g}: {e.words}")
        if h.id in STORIES:
            unknown = {"channel": STORIES[h.id][0], "covariates": STORIES[h.id][1], **marks}
        else:
            causes.append(
                {
                    "id": h.id,
                    **marks,
                    "form": "other" if h.form else "same",
                    "parameters": {e.key: round(h.size, 6)} if e.key and not h.form else {},
                }
            )
    dead = ["laser.dropout"] if c.laser and "laser.dropout" not in c.z else []
    return {
        "kind": kind,
        "causes": causes,
        "neutral": ["base.process_noise", *dead],
        "unknown": unknown,
        "wrong": sentence or None,
        "sentence": "; ".join(said) or sentence or "nothing",
        **({"rivals": c.rivals} if c.dull else {}),
    }


def _queries(r: score.Record, rng: np.random.Generator) -> tuple[list[tuple[int, int]], laser.Mask]:
    """Intervals asked, by rows, and which rows are given."""
    asked, used, scans = [], np.ones(len(r.t), dtype=bool), r.scan_t[np.isin(r.scan_t, r.t)]
    for a in np.linspace(8, r.drive.t[-1] - 8, int(rng.integers(7, 11))):
        i = int(np.searchsorted(r.t, a + rng.uniform(-1, 1)))
        j = int(np.searchsorted(r.t, r.t[i] + rng.uniform(0.5, 2.5)))
        if not ((scans > r.t[i]) & (scans <= r.t[j])).any() and used[i] and r.t[j] - r.t[i] < 3:
            asked.append((i, j))
            used[i + 1 : j + 1] = False
    return asked, used


def _tables(c: Case, rng: np.random.Generator, volts: bool) -> tuple[dict[str, Tables], list[score.Row]]:
    """All tables of all drives, and the answers to the queries of the last."""
    drives: dict[str, Tables] = {}
    dead = np.isin(np.arange(c.fan.beams), rng.integers(0, c.fan.beams, 2))
    for r in c.records:
        tables = {
            **commands(r.drive, volts),
            "covariate": {"t": r.drive.t[::50], **{k: a[::50] for k, a in r.drive.columns.items()}},
        }
        got = readings(shoot(r.drive, r.fan, r.boxes, r.path, r.scan_t, c.hidden), rng, dead)
        used, keep, last = np.ones(len(r.t), dtype=bool), np.ones(len(r.scan_t), dtype=bool), r is c.records[-1]
        if last:
            (asked, used), keep = _queries(r, rng), ~np.isin(r.scan_t, r.t)
            at = {int(np.searchsorted(r.t, t)): got[k] for k, t in enumerate(r.scan_t) if not keep[k]}
            models = [score.Predictor(r, c.noise, h, used) for h in ([], c.hidden)]
            rows = score.motion_rows(r, models, asked) + score.scan_rows(r, models, at)
            pairs = sorted([(r.t[i], r.t[j]) for i, j in asked] + [(r.t[i], r.t[i]) for i in at])
            tables["query"] = dict(zip(("t0", "t1"), np.array(pairs).T, strict=True))
        th = (r.poses[used, 2] + np.pi) % (2 * np.pi) - np.pi
        tables["pose"] = {"t": r.t[used], "x": r.poses[used, 0], "y": r.poses[used, 1], "theta": th}
        if c.laser:
            tables["scan"] = {"t": r.scan_t[keep], **{f"r{i}": a for i, a in enumerate(got[keep].T)}}
        drives[r.drive.name] = tables
    return drives, rows


def _meta(c: Case, out: Path, drawn: list[laser.Box]) -> None:
    """meta.yaml, and what it names."""
    names = [r.drive.name for r in c.records]
    meta: dict[str, object] = {"train": names[: c.train], "test": names[c.train :], "robot": "velocity"}
    if c.law is not None:
        meta |= {"robot": "md100", "model": "chair.yaml"}
        (out / "chair.yaml").write_text(yaml.safe_dump({**motion.MODEL, "voltage_law": c.law.name}, sort_keys=False))
    if c.laser:
        meta |= {
            "world": "room.world",
            "laser": {
                "x": MOUNT["x"],
                "y": MOUNT["y"],
                "yaw": 0.0,
                "angle_min": c.fan.first,
                "angle_increment": c.fan.step,
                "beams": c.fan.beams,
                "time_increment": c.fan.dt,
            },
        }
        (out / "room.world").write_text(laser.text(drawn))
    (out / "meta.yaml").write_text(yaml.safe_dump(meta, sort_keys=False))


def make(out: Path, kind: str, seed: int) -> None:
    """Writes recording, truth and answers of one case."""
    sentence = turn([w[1] for w in WRONGS], kind, seed) if kind == "wrong" else ""
    need = next((w[0] for w in WRONGS if w[1] == sentence), "any")
    c, rng = prepare(kind, seed, need), np.random.default_rng([zlib.crc32(kind.encode()), seed, 99])
    drives, rows = _tables(c, rng, need == "volts" or bool(rng.random() < 0.5))
    spoil(drives, sentence)
    folder, unix = out / "recording", float(rng.choice([0.0, 1.7e9 + seed * 1000.0]))
    if any(h.id == "laser.warmup" for h in c.hidden):
        unix = 1.7e9 + seed * 1000.0  # it goes on from drive to drive: their times must say when each began
    folder.mkdir(parents=True, exist_ok=True)
    _meta(c, folder, laser.room(rng) if "another room" in sentence else c.boxes)
    zero = {r.drive.name: unix + r.drive.start if unix else 0.0 for r in c.records}
    for name, tables in drives.items():
        write(folder / name, tables, zero[name])
    (out / "truth.json").write_text(json.dumps(_truth(c, kind, sentence), indent=1) + "\n")
    with (out / "answers.csv").open("w", newline="") as f:
        w = csv.writer(f)
        w.writerow(["run", "channel", "t0", "t1", "beam", "value", "base_mean", "base_sd", "oracle_mean", "oracle_sd"])
        for name, channel, t0, t1, beam, *rest in rows:
            w.writerow([name, channel, *(f"{t + zero[name]:.4f}" for t in (t0, t1)), beam, *(f"{a:.6f}" for a in rest)])
