# SPDX-License-Identifier: BSD-3-Clause
"""Draw a case of some kind, see whether it shows, and write it."""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.knoll.catalogue import BASE, CONFOUNDED, LASER, PLAIN, SCATTER, draw_cause, draw_unknown
from kurumaisu.bench.strangers.knoll.driving import draw_drive, open_rates
from kurumaisu.bench.strangers.knoll.files import write
from kurumaisu.bench.strangers.knoll.judge import judge
from kurumaisu.bench.strangers.knoll.motions import observe
from kurumaisu.bench.strangers.knoll.scans import beam_times, read, shoot, strays
from kurumaisu.bench.strangers.knoll.scene import draw_scene
from kurumaisu.bench.strangers.knoll.things import DT, Cause, Drive, Rng, Scene

_WRONG = {
    "pose_mm": "positions are in mm",
    "range_mm": "ranges are in mm",
    "degrees": "headings are in degrees",
    "sign_w": "commanded yaw rates have the wrong sign",
    "swap_xy": "x and y of the poses are swapped",
    "clockwise": "headings are clockwise",
    "stamps_ms": "stamps are in ms",
    "clock_off": "the clock of the poses is 3.7 s off",
    "other_poses": "poses are of another drive",
    "mirrored_map": "the map is mirrored",
    "mirrored_fan": "the fan is mirrored",
    "other_map": "the map is of another room",
    "twice": "run_2 is run_1 again",
    "sign_v": "commanded speeds have the wrong sign",
    "scan_clock_off": "the clock of the scans is 3.7 s off",
}
_OF_SCANS = ("range_mm", "mirrored_map", "mirrored_fan", "other_map", "scan_clock_off")
_BESIDE = {"single": 6, "form": 6, "pair": 4, "triple": 4}
_COUNT = {"null": 0, "unknown": 0, "wrong": 0, "pair": 2, "triple": 3}


def _fits(names: Sequence[str]) -> bool:
    """Return whether these can be hidden together."""
    hidden = set(names)
    if hidden & set(LASER) and hidden & {"clock_scale", "steering_law"}:
        return False
    return len(names) == 1 or not ("steering_law" in hidden or len(hidden & SCATTER) > 1)


def _draw_names(rng: Rng, kind: str) -> tuple[list[str], str]:
    """Draw what to hide, and how drives are limited."""
    if kind == "confounded":
        name, mode = CONFOUNDED[rng.integers(len(CONFOUNDED))]
        return [name], mode
    count = _COUNT.get(kind, 1)
    pool = [n for n in BASE + LASER if kind != "form" or n not in PLAIN]
    while count:
        names = [str(n) for n in rng.choice(pool, count, replace=False)]
        if _fits(names):
            return names, ""
    return [], ""


def _scans(rng: Rng, sc: Scene, causes: Sequence[Cause], x: Drive, stray: bool) -> None:
    """Draw the scans of a drive."""
    t = np.arange(1.0, x.n * DT - 1.5, 1 / sc.scan_rate)
    x.st = np.asarray(np.round(t + rng.uniform(0, 0.1, t.size), 6), float)
    ta = beam_times(sc, causes, x.st)
    x.scans = read(rng, sc, causes, *shoot(sc, causes, x, x.at(ta), ta))
    if stray:
        x.scans = strays(rng, sc, x.scans)


def _simulate(rng: Rng, sc: Scene, causes: Sequence[Cause], mode: str) -> list[Drive]:
    """Draw all drives with reference and scans."""
    drives, day = list[Drive](), 0.0
    count = int(rng.integers(3, 5))
    for k in range(count):
        x = draw_drive(rng, sc, causes, float(rng.uniform(90, 180)), mode, day)
        x.vm, x.wm, _ = open_rates(sc, causes, x)
        observe(rng, sc, causes, x)
        if sc.fan:
            _scans(rng, sc, causes, x, k + 1 < count)
        drives.append(x)
        day += x.n * DT + float(rng.uniform(20, 60))
    return drives


def _truth(kind: str, sc: Scene, causes: Sequence[Cause], judged: list[tuple[float, float]], wrong: str) -> str:
    """Return truth.json."""
    told: list[dict[str, Any]] = []
    unknown: dict[str, Any] | None = None
    for c, (z, b) in zip(causes, judged, strict=True):
        sure = {"z": round(z, 2), "beside": round(b, 2)}
        if c.unknown:
            unknown = {"channel": c.unknown[0], "covariates": [c.unknown[1]], **sure}
        else:
            form, parameters = ("other", {}) if c.other else ("usual", c.told)
            told.append({"id": c.id, **sure, "form": form, "parameters": parameters})
    ids = [c.id for c in causes]
    what = ", ".join(ids) or ("wrong data: " + wrong if wrong else "nothing hidden")
    neutral = ["base.process_noise"] * ("base.process_noise" not in ids) + ["laser.heavy_tails"] * (sc.strays > 0)
    truth = {
        "kind": kind,
        "causes": told,
        "neutral": neutral,
        "unknown": unknown,
        "wrong": _WRONG[wrong] if wrong else None,
        "sentence": f"{sc.robot} with {sc.fan.name if sc.fan else 'no laser'}, {sc.ref.name}: {what}",
    }
    return json.dumps(truth, indent=1) + "\n"


def make(folder: Path, kind: str, seed: int) -> None:
    """Write a case of a kind into a folder, or raise RuntimeError where none is strong enough."""
    rng = np.random.default_rng([seed, zlib.crc32(b"knoll"), zlib.crc32(kind.encode())])
    wrong = str(rng.choice(list(_WRONG))) if kind == "wrong" else ""
    for attempt in range(30):
        if attempt % 5 == 0:
            names, mode = _draw_names(rng, kind)
            first = float(np.exp(rng.uniform(np.log(0.4), 0.1)))
            some = kind in ("pair", "triple")
            others = [kind == "form" or (some and n not in PLAIN and rng.random() < 0.2) for n in names]
        sc = draw_scene(rng, names, kind == "unknown", wrong in _OF_SCANS)
        size = first * 1.35 ** (attempt % 5)
        causes = [draw_cause(n, rng, sc, size, other) for n, other in zip(names, others, strict=True)]
        if kind == "unknown":
            causes = [draw_unknown(rng, sc, size)]
        drives = _simulate(rng, sc, causes, mode)
        judged = judge(sc, causes, drives[:-1])
        if all(z >= 10 and b >= _BESIDE.get(kind, 0) for z, b in judged):
            write(Path(folder), rng, sc, causes, drives, wrong, _truth(kind, sc, causes, judged, wrong))
            return
    raise RuntimeError(f"no draw of {kind} {seed} is strong enough")
