# SPDX-License-Identifier: BSD-3-Clause
"""Make one recording: draw until what is hidden shows, then write it with truth and answers."""

import csv
import json
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from . import write as bad
from .base import ACTS, MARKERS
from .model import Cause, Run
from .plan import (
    LASER,
    LIMITS,
    NOISY,
    TWINS,
    Case,
    Judge,
    UnluckyError,
    is_base,
    monotone,
    plain,
    project_one,
    rivals,
    scaled,
    setting,
    shared,
    size,
)
from .room import make_room
from .unknown import SORTS
from .write import Tables, answers, dump, fresh, meta, save, tables

KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")
BASE, LASERS = [f"base.{n}" for n in (*ACTS, *MARKERS)], [f"laser.{n}" for n in LASER]
ALL = [*BASE, *LASERS, "world.map_error"]
NO_FORMS = ("base.marker_x", "base.marker_y", "base.marker_yaw", "laser.mount_x", "laser.mount_y", "laser.mount_yaw")
ONE_FORM = (
    "laser.tilt",
    "world.map_error",
    "laser.beam_correlation",
    "laser.saturation",
    "laser.dropout",
    "base.steering_law",
)
FORMS = [(n, f) for n in ALL if n not in NO_FORMS for f in ((1,) if n in ONE_FORM else (1, 2))]
UNSCANNED = (*(f"base.{n}" for n in MARKERS), "base.clock_scale")
MONOTONE = {
    "one_speed": ("gain_v", "curvature_v", "dac_zero_f", "dead_zone_v"),
    "one_turn": ("gain_w", "curvature_w", "dead_zone_w"),
    "left_only": ("gain_w", "left_right_gain", "dac_zero_s", "curvature_w", "dead_zone_w"),
    "forward_only": ("dac_zero_f", "dead_zone_v"),
    "one_speed_one_turn": ("gain_w", "curvature_w", "dead_zone_w", "gain_v", "curvature_v", "understeer"),
}
Told = list[tuple[float, float]]


def _needs(causes: list[Cause]) -> tuple[bool, tuple[str, ...]]:
    scans = any(c.id.startswith(("laser", "world", "unknown.range", "unknown.scatter")) for c in causes)
    names = tuple(SORTS[c.id].column for c in causes if c.id in SORTS and SORTS[c.id].column)
    return scans, (*names, *(("temperature",) if any(c.id == "laser.temperature" for c in causes) else ()))


def _noisy(case: Case, judge: Judge, c: Cause) -> tuple[float, float]:
    """How a cause of the scatter shows, and beside noise of another size."""
    if c.id == "base.process_noise":
        return judge.rates(c)
    if c.id.startswith("unknown.scatter") or c.id in ("laser.range_noise", "laser.incidence_noise"):
        near = [plain(n) for n in ("laser.range_noise", "laser.incidence_noise") if n != c.id]
        near += [Cause("", {})] if c.id != "laser.range_noise" else []
        return project_one(judge.spread([c, *near]), 0, list(range(1, 1 + len(near))))
    z = float(np.sqrt(max(sum(float(t.sum()) for t in case.told[: case.train]), 0.0)))
    return z, z


def weigh(case: Case, c: Cause, judge: Judge) -> tuple[float, float]:
    """Signal to noise of a cause, alone and beside rivals or the other causes."""
    others = [d for d in case.causes if d is not c]
    if c.id in (*NOISY, "base.process_noise"):
        if others:
            keep = case.causes
            case.scan([c]) if case.fan is not None else None
            z = _noisy(case, judge, c)
            case.scan(keep) if case.fan is not None else None
            return z
        return _noisy(case, judge, c)
    if is_base(c):
        near = [d for d in others if is_base(d)] if others else rivals(c, False)
        pairs = [(case.causes, others)]
        pairs += [(case.causes, [d for d in case.causes if d is not e]) if others else ([e], []) for e in near]
        gram = judge.base(pairs)
    else:
        near = [d for d in others if not is_base(d) and d.id not in NOISY] if others else rivals(c, True)
        gram = judge.laser([c, *near])
    return (shared if others else project_one)(gram, 0, list(range(1, len(near) + 1)))


def _draw(kind: str, ids: list[str], form: int, seed: int, least: float) -> tuple[Case, Told]:
    """Draw drives and sizes once; UnluckyError if something does not show."""
    rng = np.random.default_rng(seed)
    first = [plain(n, rng, form) for n in ids]
    scans, names = _needs(first)
    scans = scans or (rng.random() < 0.4 and not any(n in UNSCANNED for n in ids))
    style = monotone(rng) if kind == "confounded" else ""
    if kind == "confounded":
        first, scans = [plain(f"base.{rng.choice(MONOTONE[style])}", rng)], False
    case = setting(seed, scans, style, names)
    case.grey = "laser.reflectance" in ids
    case.finish([])
    done: list[Cause] = []
    for c in sorted(first, key=lambda k: not is_base(k)):
        top = 22.0 if kind == "confounded" else 55.0 if len(first) == 1 else 40.0
        target = float(np.exp(rng.uniform(np.log(13), np.log(top))))
        target *= 3 if "probability" in c.p else 1
        done.append(size(case, c, target, rng))
        if is_base(c):
            case.finish(done)
        for _ in range(4 if c.id in (*NOISY, "base.process_noise") else 0):
            case.finish([done[-1]]) if is_base(c) else case.scan([done[-1]])
            z = _noisy(case, Judge(case), done[-1])[0]
            if z > 11 and abs(np.log(z / target)) < 0.5:
                break
            done[-1] = scaled(done[-1], float(np.clip(target / max(z, 1.0), 0.2, 4.0)))
    case.finish(done)
    for c in done:
        if any(abs(v) > LIMITS.get(k, 1e9) for k, v in c.p.items() if c.id not in SORTS):
            raise UnluckyError(f"{c} is too large")
    judge = Judge(case)
    told = [weigh(case, c, judge) for c in done]
    if any(not z >= 10 for z, _ in told) or (kind != "confounded" and any(b < least for _, b in told)):
        raise UnluckyError(str(told))
    return case, told


def _members(case: Case) -> tuple[list[str], float]:
    """Which plain causes would draw the same, and what the best leaves."""
    judge, c = Judge(case), case.causes[0]
    near = rivals(c, False)
    gram = judge.base([([c], []), *(([e], []) for e in near)])
    out, least = {c.id, *([TWINS[c.id]] if c.id in TWINS else [])}, 1e9
    for i, e in enumerate(near, 1):
        z, left = project_one(gram, 0, [i])
        sign_free = ACTS[e.id[5:]][4] if e.id[5:] in ACTS else True
        if left < min(2.0, z) and gram[i, i] > 0 and (sign_free or gram[0, i] > 0):
            out.add(e.id)
            least = min(least, left)
    return sorted(out), least


def _ids(kind: str, seed: int, rng: np.random.Generator) -> tuple[list[str], int]:
    """What a seed hides, all of the catalogue in turn."""
    if kind == "single":
        return [ALL[seed * 17 % len(ALL)]], 0
    if kind == "form":
        n, f = FORMS[seed * 19 % len(FORMS)]
        return [n], f
    if kind == "unknown":
        return [list(SORTS)[seed * 11 % len(SORTS)]], 0
    if kind in ("pair", "triple"):
        pool = [n for n in ALL if n not in (*UNSCANNED, "base.steering_law", "base.process_noise")]
        some = pool if rng.random() < 0.5 else [k for k in pool if k in BASE]
        return [str(n) for n in rng.permutation(some)[: 2 if kind == "pair" else 3]], 0
    return [], 0


def _search(kind: str, seed: int, tell: Callable[[str], None]) -> tuple[Case, Told, list[str], float]:
    for n in range(40):
        one = seed * 1000 + n * 7 + zlib.crc32(kind.encode()) % 997 * 10**6
        ids, form = _ids(kind, seed + (n // 8), np.random.default_rng(one))
        try:
            case, told = _draw(kind, ids, form, one, 4.0 if kind in ("pair", "triple") else 6.0)
        except UnluckyError as why:
            tell(f"{ids} {why}")
            continue
        if kind == "confounded":
            members, left = _members(case)
            if left >= 2:
                tell(f"{case.causes[0].id} is alone")
                continue
            return case, [(told[0][0], left)], members, left
        told_ids = {c.id for c in case.causes if c.id not in SORTS}
        return case, told, sorted(told_ids | {TWINS[n] for n in told_ids if n in TWINS}), 0.0
    raise RuntimeError(f"{kind} {seed}: nothing shows")


def make(out: Path, kind: str, seed: int, tell: Callable[[str], None] = lambda s: None) -> None:
    """Write OUT/recording, OUT/truth.json and OUT/answers.csv."""
    if kind not in KINDS:
        raise ValueError(f"{kind} is none of {KINDS}")
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    sentence = list(bad.WRONGS)[seed * 13 % len(bad.WRONGS)] if kind == "wrong" else ""
    members: list[str] = []
    told: Told = []
    if kind in ("null", "wrong"):
        needs = bad.WRONGS[sentence][1] if sentence else ""
        case = setting(int(rng.integers(2**31)), "scan" in needs or rng.random() < 0.6)
        case.volts = case.volts or "volts" in needs
        case.finish([])
    else:
        case, told, members, _ = _search(kind, seed, tell)
    if sentence and "stamp" in bad.WRONGS[sentence][1]:
        for r in case.runs:
            r.start += 1.6e9 - case.runs[0].start
    rec, said = fresh(out), meta(case, bool(rng.random() < 0.3))
    rows, tabs = [], []
    for i in range(len(case.runs)):
        t = tables(case, i, rng, i >= case.train or kind == "wrong")
        if i >= case.train:
            rows += _withhold(case, i, t, rec, rng)
        tabs.append(t)
    where = [r.start for r in case.runs]
    if sentence:
        _spoil(tabs, said, sentence, rng, where)
    for r, t, s in zip(case.runs, tabs, where, strict=True):
        save(rec / r.name, t, s)
    dump(rec, said)
    if case.room is not None:
        how = bad.WRONGS[sentence][1].split()[2:] if sentence else []
        far = make_room(np.random.default_rng(seed).uniform(-2, 2, 40), np.zeros(40), np.random.default_rng(seed + 77))
        (bad.spoiled(case.room, how[0], far) if how else case.room).write(rec, "room")
    (out / "truth.json").write_text(json.dumps(_truth(kind, case, told, members, sentence), indent=1) + "\n")
    with (out / "answers.csv").open("w", newline="") as f:
        w = csv.writer(f)
        w.writerow(["run", "channel", "t0", "t1", "beam", "value", "base_mean", "base_sd", "oracle_mean", "oracle_sd"])
        w.writerows([[f"{z:.6g}" if isinstance(z, float) else z for z in row] for row in rows])


def _withhold(case: Case, i: int, t: Tables, rec: Path, rng: np.random.Generator) -> list[tuple[object, ...]]:
    """Keep the answers of a test drive back, and ask for them."""
    r: Run = case.runs[i]
    rows, queries, seen, use = answers(case, i, rng)
    head, a = t["pose"]
    t["pose"] = (head, a[seen > 0])
    if "scan" in t:
        head, a = t["scan"]
        t["scan"] = (head, a[np.isin(a[:, 0], r.st[use > 0])])
    (rec / r.name).mkdir(parents=True, exist_ok=True)
    text = "".join(f"{a:.6f},{b:.6f}\n" for a, b in queries)
    (rec / r.name / "query.csv").write_text("t0,t1\n" + text)
    return rows


def _spoil(tabs: list[Tables], said: dict[str, Any], how: str, rng: np.random.Generator, where: list[float]) -> None:
    """Make the tables contradict each other; of times in other units the stamps are written as they are."""
    if "stamp" in bad.WRONGS[how][1]:
        for t, s in zip(tabs, where, strict=True):
            for _, a in t.values():
                a[:, 0] += s
        where[:] = [0.0] * len(where)
    bad.WRONGS[how][0](tabs, said, rng)
    if "twice" in how:
        where[1] = where[0]


def _truth(kind: str, case: Case, told: Told, members: list[str], sentence: str) -> dict[str, Any]:
    """What truth.json says."""
    other, causes = None, []
    for c, (z, beside) in zip(case.causes, told, strict=False):
        zb = {"z": round(z, 2), "beside": round(beside, 2)}
        if c.id in SORTS:
            other = {"channel": SORTS[c.id].channel, "covariates": list(SORTS[c.id].covariates), **zb}
            other["sort"], other["sizes"] = c.id, c.p
            continue
        p = {k: round(abs(float(v)) if k == "sd" else float(v), 6) for k, v in c.p.items() if k != "seed"}
        causes.append({"id": c.id, "form": "other" if c.form else "plain", "parameters": {} if c.form else p, **zb})
        causes[-1]["equation"] = c.form
    n = case.noise
    note = f"noise sd_v {n.v:.4f} sd_w {n.w:.4f} tau {n.tau:.3f}; style {case.style or 'mixed'}; "
    note += f"scans, pixels of {case.room.res:g} m" if case.room is not None else "no scans"
    return {
        "kind": kind,
        "causes": causes,
        "members": members,
        "unknown": other,
        "wrong": sentence or None,
        "neutral": ["base.process_noise"],
        "note": note,
    }
