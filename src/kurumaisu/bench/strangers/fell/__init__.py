# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of robots in which something is hidden."""

import zlib
from pathlib import Path
import numpy as np
from kurumaisu.bench.strangers.fell.catalogue import CONFOUNDED, IDS, VOLTS, draw, draw_unknown
from kurumaisu.bench.strangers.fell.files import write
from kurumaisu.bench.strangers.fell.judge import Judge
from kurumaisu.bench.strangers.fell.scene import stage

WRONG = (
    "poses in mm,degrees,y mirrored,swapped axes,clockwise headings,stamps in ms,speed reversed,"
    "a clock seconds off,poses of another drive,a drive given twice,ranges in mm,mirrored map,"
    "mirrored fan,another map"
).split(",")
PLAIN = ("base.steering_law", "base.sign", "laser.saturation", "laser.mixed_pixels")  # have one equation, or are huge


def make(folder: Path, kind: str, seed: int) -> None:
    """Writes a case of a kind into a folder, or raises RuntimeError where none is strong enough."""
    lead = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    unknown, limit, pool = None, "", [i for i in IDS if kind != "form" or i not in PLAIN]
    count = {"null": 0, "wrong": 0, "unknown": 0, "pair": 2, "triple": 3}.get(kind, 1)
    wrong = WRONG[int(lead.integers(len(WRONG)))] if kind == "wrong" else ""
    for attempt in range(30):
        if attempt % 5 == 0:
            ids, size = [str(i) for i in lead.choice(pool, count, replace=False)], 1.0
            if kind == "confounded":
                i, limit = CONFOUNDED[int(lead.integers(len(CONFOUNDED)))]
                ids = [i]
            sub = int(lead.integers(1 << 30))
        rng = np.random.default_rng([zlib.crc32(kind.encode()), seed, attempt])
        own, channel, of = np.random.default_rng(sub), "", ""
        causes = [draw(i, own, size, other=kind == "form") for i in ids]
        need = any(not i.startswith("base.") for i in ids) or wrong in WRONG[-4:]
        if kind == "unknown":
            c, channel, of = draw_unknown(own, size)
            causes, need = [c], channel.startswith("laser")
        try:
            sc = stage(rng, causes, any(i in VOLTS for i in ids), need, limit)
        except RuntimeError:
            continue
        score = Judge(sc).score() if causes else []
        bar = {"pair": 4, "triple": 4, "unknown": 0, "confounded": 0}.get(kind, 6)
        if all(z >= 10 and b >= bar for z, b in score):
            break
        low = min(min(z / 10, b / max(bar, 1) if z >= 10 and bar else 9) for z, b in score)
        size *= float(np.clip(1.15 / max(low, 0.05), 1.35, 2.5))
    else:
        raise RuntimeError(f"{kind} {seed}: no case that is strong enough")
    told = [
        {
            "id": c.id,
            "z": round(z, 1),
            "beside": round(b, 1),
            "form": "other" if c.other else "usual",
            "parameters": {k: round(float(c.p[k]), 6) for k in c.told},
        }
        for c, (z, b) in zip(causes, score)
    ]
    if kind == "unknown":
        unknown = {"channel": channel, "covariates": [of], "z": told[0]["z"], "beside": told.pop()["beside"]}
    what = wrong or ", ".join(c.id for c in causes) + (f" follows {of}" if of else "") or "nothing"
    where = {"speed": " in drives of one speed only", "left": " in drives of left turns only", "": ""}[limit]
    sentence = f"{sc.robot.kind}, {sc.ref.name}, {sc.las.name if sc.las else 'no laser'}: {what}{where}"
    neutral = [i for i in ("base.process_noise", "laser.heavy_tails") if i not in [c.id for c in causes]]
    truth = {
        "kind": kind,
        "causes": told,
        "neutral": neutral,
        "unknown": unknown,
        "wrong": wrong or None,
        "sentence": sentence,
    }
    write(Path(folder), rng, sc, truth, wrong)
