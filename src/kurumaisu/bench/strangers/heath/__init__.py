# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of an electric wheelchair in which something is hidden, for testing a critic of its model."""

import json
from pathlib import Path

import numpy as np

from .record import tables, write
from .scene import hidden, neutral, parameters
from .strange import break_tables

KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")


def make(out: Path, kind: str, seed: int) -> None:
    """Write OUT/recording, OUT/truth.json and OUT/answers.csv."""
    s, key = hidden(kind, seed, KINDS.index(kind))
    data, answers, given = tables(s, key)
    if s.wrong:
        break_tables(s.wrong, data, s.room, np.random.default_rng([*key, 5]))
    write(Path(out) / "recording", s, data, given)
    unknown, causes = None, []
    for c, (z, beside, _) in zip(s.causes, s.scores, strict=True):
        size = {"z": round(z, 2), "beside": round(beside, 2)}
        if kind == "unknown":
            unknown = s.unknown | size
        elif c.form == "plain":
            sizes = {k: round(float(v), 6) for k, v in parameters(c).items()}
            causes.append({"id": c.id, "form": "plain", "parameters": sizes, **size})
        else:
            causes.append({"id": c.id, "form": "other", **size})
    note = "; ".join(f"{c.id} ({c.form}: {c.rule}, a = {c.size:.4g}, {c.shape})" for c in s.causes)
    truth = {
        "kind": kind,
        "causes": causes,
        "members": s.members,
        "unknown": unknown,
        "wrong": s.wrong,
        "neutral": neutral(s),
        "note": note or s.wrong or "the model and its noise",
    }
    (Path(out) / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    lines = ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    lines += [
        ",".join([run, channel, f"{t0:.6f}", f"{t1:.6f}", str(beam), *(f"{q:.6f}" for q in numbers)])
        for run, channel, t0, t1, beam, *numbers in answers
    ]
    (Path(out) / "answers.csv").write_text("\n".join(lines) + "\n")
