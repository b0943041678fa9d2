# SPDX-License-Identifier: BSD-3-Clause
"""Draw a case of some kind, see whether it shows, and write it."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kurumaisu.bench.strangers.tarn import base, labs
from kurumaisu.bench.strangers.tarn.base import Drive, Effect, Effects, Lab, Laser, Rng, seen, write_csv
from kurumaisu.bench.strangers.tarn.judge import Judge, Oracle, to_frame
from kurumaisu.bench.strangers.tarn.laser import Room, build, bursts, draw, mean, scatter, trace, write_room

NEED = {"single": 6.0, "form": 6.0, "pair": 4.0, "triple": 4.0, "unknown": 6.0}
ODD = {
    "base.v": ["heading", "tyre", "time", "time_since_rest", "humidity"],
    "base.pose": ["x", "y"],
    "base.w": ["tyre", "time", "abs_v", "lux", "humidity"],
    "laser.spread": ["lux", "humidity", "tyre", "w"],
    "laser.range": ["hit_x", "hit_y", "tyre", "humidity", "lux", "time"],
}
CONFUSED = [
    ("one_speed", ["base.gain_v", "base.curvature_v"]),
    ("one_curve", ["base.gain_w", "base.understeer"]),
    ("one_turn", ["base.gain_w", "base.left_right_gain", "base.curvature_w"]),
]
_WRONG = """poses in mm|headings in degrees|v has the wrong sign|w has the wrong sign|x and y of poses swapped
the headings are clockwise|the poses' clock is 3 s late|stamps of the poses in ms|poses of another drive|v in km/h
the map is mirrored|the fan is mirrored|scans in mm|the scans' clock is 4 s late|another map|one drive is given twice"""
WRONG = _WRONG.replace("\n", "|").split("|")
NEUTRAL = ["base.process_noise", "laser.dropout", "laser.heavy_tails", "laser.common_mode"]


class Case(NamedTuple):
    """A case before it is written."""

    lab: Lab
    drives: list[Drive]
    room: Room | None
    fx: Effects
    strengths: dict[str, tuple[float, float]]
    wrong: str


def _odd(rng: Rng, lab: Lab, what: str, strength: float) -> Effect:
    channel, cov = what.split(":")
    size = {"base.v": 0.12, "base.w": 0.12, "base.pose": 0.03, "laser.range": 0.008, "laser.spread": 1.5}[channel]
    mid, wide = {
        "heading": (0.3, np.pi),
        "time": (10.0, 45.0),
        "tyre": (2.5, 1.0),
        "lux": (300.0, 150.0),
        "humidity": (45.0, 12.0),
        "time_since_rest": (6.0, 9.0),
        "abs_v": (0.5 * lab.vmax, 0.6 * lab.vmax),
        "x": (0.2, lab.half[0]),
        "y": (0.1, lab.half[1]),
        "hit_x": (0.3, 1.6 * lab.half[0]),
        "hit_y": (-0.2, 1.6 * lab.half[1]),
        "w": (0.4, 1.0),
    }[cov]
    wave = float(cov in ("heading", "time", "x", "y", "hit_x", "hit_y"))
    p = {"size": size * strength * rng.uniform(0.8, 1.3), "mid": mid, "wide": wide, "wave": wave}
    return Effect("unknown", p, channel=channel, covariate=cov)


def _choose(rng: Rng, kind: str) -> tuple[list[str], bool, str]:
    """Ids to hide, whether the robot is the wheelchair, how it is driven."""
    chair, manner, ids = bool(rng.random() < 0.5), "", list[str]()
    if kind == "unknown":
        ids = [":".join([c := str(rng.choice(list(ODD))), str(rng.choice(ODD[c]))])]
    elif kind == "confounded":
        manner, some = CONFUSED[int(rng.integers(len(CONFUSED)))]
        ids = [str(rng.choice(some))]
    elif kind not in ("null", "wrong"):
        many = {"single": 1, "form": 1, "pair": 2, "triple": 3}[kind]
        ids = [str(i) for i in rng.choice(labs.ALT if kind == "form" else labs.IDS, many, replace=False)]
    return ids, chair or bool(labs.VOLTAGE & set(ids)), manner


def _drives(rng: Rng, lab: Lab, fx: Effects) -> list[Drive]:
    out, at, many = list[Drive](), 0.0, int(rng.integers(3, 5))
    for k in range(many):
        long = float(rng.uniform(90, 200) if k < many - 1 else rng.uniform(130, 165))
        out.append(labs.drive(rng, lab, f"run_{k + 1}", at, long, lambda d: base.simulate(lab, d, fx)))
        base.refer(rng, lab, out[-1], fx)
        at += float(np.round(long + rng.uniform(20, 200), 2))
    return out


def _scan(rng: Rng, las: Laser, room: Room, d: Drive, fx: Effects) -> None:
    t = d.t[0] + 0.5 + np.cumsum(np.clip(rng.normal(1, 0.02, int((d.t[-1] - d.t[0]) * las.rate)), 0.8, 1.3)) / las.rate
    d.ts = np.round(t[(t < d.t[-1] - 0.6) & (rng.random(len(t)) > 0.01)], 6)
    which = d.ts, np.arange(las.beams), float(d.t[0])
    q = trace(room, las, fx, lambda t: seen(d, Effects([]), (d.x, d.y, d.th), t), *which)
    m = mean(las, fx, q, d)
    d.scans = draw(rng, las, fx, q, m, scatter(las, fx, q, m, d, bursts(rng, las, fx, d.ts)))


def _attempt(rng: Rng, kind: str, ids: list[str], chair: bool, manner: str, strength: float) -> Case | None:
    wrong = str(rng.choice(WRONG)) if kind == "wrong" else ""
    scans = any(w in wrong for w in ("map", "fan", "scans")) or any(not i.startswith("base") for i in ids)
    column = any(i.endswith(("tyre", "lux", "humidity", "temperature")) for i in ids)
    lab = labs.draw_lab(rng, chair, bool(scans or rng.random() < 0.5), ids, column, manner)
    if not all(":" in i or labs.possible(lab, i) for i in ids):
        return None
    form = kind == "form"
    fx = Effects(
        [_odd(rng, lab, i, strength) if ":" in i else labs.draw_effect(rng, lab, i, strength, form) for i in ids]
    )
    drives, room = _drives(rng, lab, fx), None
    if lab.laser:
        px, py = (np.concatenate([getattr(d, a)[::25] for d in drives]) for a in "xy")
        room = build(rng, lab, px, py)
        for d in drives:
            _scan(rng, lab.laser, room, d, fx)
    z = Judge(lab, drives[:-1], room, fx).strengths() if fx.all else {}
    strong = all(a >= 10 and (b < 1 if kind == "confounded" else b >= NEED[kind]) for a, b in z.values())
    return Case(lab, drives, room, fx, z, wrong) if strong else None


def _queries(rng: Rng, d: Drive) -> tuple[list[tuple[int, int]], list[int]]:
    """Rows between which to predict motions, and scans to predict."""
    motions, scans, at, good = list[tuple[int, int]](), list[int](), d.stamp[0] + 3.5, np.flatnonzero(~d.bad)
    while at < d.stamp[-1] - 7:
        i0 = int(good[d.stamp[good] >= at][0])
        i1 = int(good[d.stamp[good] >= d.stamp[i0] + rng.uniform(1.8, 2.2)][0])
        if d.stamp[i1] - d.stamp[i0] < 2.6:
            motions.append((i0, i1))
            free = np.flatnonzero((d.ts > d.stamp[i1] + 1.6) & (d.ts < d.stamp[-1] - 1))
            if len(free) and len(scans) < 9 and rng.random() < 0.6:
                scans.append(int(free[0]))
        at = d.stamp[i0] + rng.uniform(5.5, 6.3)
    return motions, scans


def _answers(rng: Rng, case: Case, folder: Path) -> None:
    """Write answers.csv and query.csv, and take out of the test drive what is asked for."""
    lab, d = case.lab, case.drives[-1]
    (motions, scans), keep = _queries(rng, d), np.ones(len(d.stamp), bool)
    oracles = [Oracle(lab, d, case.room, f) for f in (Effects([]), case.fx)]
    rows, query = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"], list[tuple[float, float]]()

    def tell(channel: str, t0: float, t1: float, beam: str, numbers: list[float]) -> None:
        a, b, *rest = (f"{n:.6f}" for n in (t0 + lab.epoch, t1 + lab.epoch, *numbers))
        rows.append(",".join([d.name, channel, a, b, beam, *rest]))

    for i0, i1 in motions:
        query.append((d.stamp[i0], d.stamp[i1]))
        keep[i0 + 1 : i1 + 1] = False
        both = np.stack([a for o in oracles for a in o.motion(i0, i1)], 1)
        value = to_frame(d.px[[i0, i1]], d.py[[i0, i1]], d.pth[[i0, i1]], 0)[1]
        for k, name in enumerate(("dx", "dy", "dtheta")):
            tell(name, *query[-1], "", [value[k], *both[k]])
    for k in scans:
        query.append((d.ts[k], d.ts[k]))
        both = np.stack([a for o in oracles for a in o.ranges(np.random.default_rng(k), float(d.ts[k]))], 1)
        sure = np.isfinite(both).all(1) & np.isfinite(d.scans[k]) & ~(np.abs(d.scans[k] - both[:, 2]) > 8 * both[:, 3])
        for b in np.flatnonzero(sure):
            tell("range", *query[-1], str(b), [d.scans[k, b], *both[b]])
    (folder / "answers.csv").write_text("\n".join(rows) + "\n")
    write_csv(folder / "recording" / d.name / "query.csv", ["t0", "t1"], list(np.array(sorted(query)).T + lab.epoch))
    d.stamp, d.px, d.py, d.pth = (a[keep] for a in (d.stamp, d.px, d.py, d.pth))
    d.ts, d.scans = np.delete(d.ts, scans), np.delete(d.scans, scans, 0)


def _spoil(case: Case) -> Room | None:
    """Make the data wrong as a whole; the room as the map then has it."""
    w, ds, room = case.wrong, case.drives, case.room
    if w == "one drive is given twice":
        ds[1].__dict__.update({**ds[0].__dict__, "name": ds[1].name})
    if w == "poses of another drive":
        at, own = ds[0].stamp - ds[0].t[0], ds[1].stamp - ds[1].t[0]
        ds[0].px, ds[0].py, ds[0].pth = (np.interp(at, own, a) for a in (ds[1].px, ds[1].py, ds[1].pth))
    for d in ds if w != "one drive is given twice" else []:
        metres, ranges = 1000.0 if w == "poses in mm" else 1.0, 1000.0 if w == "scans in mm" else 1.0
        d.px, d.py = (d.py, d.px) if w.startswith("x and y") else (d.px * metres, d.py * metres)
        d.pth = d.pth * {"headings in degrees": 180 / np.pi, "the headings are clockwise": -1.0}.get(w, 1.0)
        d.vc = d.vc * {"v has the wrong sign": -1.0, "v in km/h": 3.6}.get(w, 1.0)
        d.stamp, d.ts = d.stamp + 3.0 * w.startswith("the poses' clock"), d.ts + 4.0 * w.startswith("the scans' clock")
        d.wc = -d.wc if w.startswith("w has") else d.wc
        d.scans = (d.scans[:, ::-1] if w == "the fan is mirrored" else d.scans) * ranges
    if room and w == "another map":
        b = room.boxes * [1.25, 1.25, 1, 1, 1, 1]
        b[:4, 3], b[4:, :2] = b[:4, 3] * 1.25, b[4:, :2][::-1] * [-1, 1]
        return Room(b, room.pixel)
    return Room(room.boxes * [1, -1, -1, 1, 1, 1], room.pixel) if room and w == "the map is mirrored" else room


def _write_drive(case: Case, d: Drive, folder: Path, columns: list[str]) -> None:
    lab, e, t, v, w = case.lab, case.lab.epoch, np.arange(d.t[0], d.t[-1], 0.5), d.vc, d.wc
    if lab.kind == "md100":
        write_csv(folder / "voltage.csv", ["t", "v_f", "v_s", "v", "w"], [d.tc + e, *base.volts(v, w, lab.law), v, w])
    else:
        write_csv(folder / "command.csv", ["t", "v", "w"], [d.tc + e, v, w])
    stamp = (d.stamp + e) * (1000.0 if case.wrong == "stamps of the poses in ms" else 1.0)
    write_csv(folder / "pose.csv", ["t", "x", "y", "theta"], [stamp, d.px, d.py, d.pth])
    if lab.laser:
        names = [f"r{i}" for i in range(lab.laser.beams)]
        write_csv(folder / "scan.csv", ["t", *names], [d.ts + e, *d.scans.T], "%.6f" + ",%.4f" * len(names))
    if lab.columns:
        of = [np.interp(t, d.t, d.cov[c]) for c in columns]
        write_csv(folder / "covariate.csv", ["t", *columns], [t + e, *of], "%.4f")


def _truth(kind: str, case: Case) -> dict[str, object]:
    z = {i: {"z": round(a, 2), "beside": round(b, 2)} for i, (a, b) in case.strengths.items()}
    odd, fx = case.fx.get("unknown"), case.fx.all
    causes = [
        {"id": e.id, **z[e.id], "form": "other" if e.alt else "usual", "parameters": {k: e.p[k] for k in e.told}}
        for e in fx
        if e is not odd
    ]
    unknown = {"channel": odd.channel, "covariates": [odd.covariate], **z["unknown"]} if odd else None
    hidden = case.wrong or ", ".join(e.channel + " by " + e.covariate if e is odd else e.id for e in fx) or "nothing"
    neutral = [i for i in NEUTRAL if not case.fx.get(i) and (case.room or i.startswith("base"))]
    return {
        "kind": kind,
        "causes": causes,
        "neutral": neutral,
        "unknown": unknown,
        "wrong": case.wrong or None,
        "sentence": f"{case.lab.kind}, {case.lab.ref.kind}, {case.lab.room}: {hidden}",
    }


def make(folder: Path, kind: str, seed: int) -> None:
    """Write a case of this kind: recording/, truth.json, answers.csv."""
    rng, recording = np.random.default_rng([zlib.crc32(kind.encode()), seed]), folder / "recording"
    case, strength = None, 1.0
    for k in range(30):
        if k % 5 == 0:
            (ids, chair, manner), strength = _choose(rng, kind), 1.0
        case, strength = _attempt(rng, kind, ids, chair, manner, strength), strength * 1.35
        if case:
            break
    if not case:
        raise RuntimeError(f"no case of kind {kind} is strong enough")
    names = [d.name for d in case.drives]
    for name in names:
        (recording / name).mkdir(parents=True, exist_ok=True)
    (folder / "truth.json").write_text(json.dumps(_truth(kind, case), indent=1) + "\n")
    _answers(rng, case, folder)
    room = _spoil(case)
    (recording / "model.yaml").write_text(labs.model_text(case.lab))
    (recording / "meta.yaml").write_text(labs.meta_text(case.lab, write_room(room, recording) if room else "", names))
    wanted = {e.covariate or e.id.split(".")[1] for e in case.fx.all}
    columns = [c for c in case.drives[0].cov if c in wanted or rng.random() < 0.6] or ["humidity"]
    for d in case.drives:
        _write_drive(case, d, recording / d.name, columns)
