# SPDX-License-Identifier: BSD-3-Clause
"""A wheelchair of two wheels, driven in a room: recordings in which something is hidden."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")


def make(out: Path, kind: str, seed: int) -> None:
    """Write OUT/recording, OUT/truth.json and OUT/answers.csv."""
    from .choose import choose
    from .files import write

    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}")
    np.seterr(divide="ignore", invalid="ignore")  # rays that meet nothing
    for turn in range(60):
        rng = np.random.default_rng([zlib.crc32(kind.encode()), seed, turn])
        hidden = choose(kind, seed, turn, rng)
        if hidden is not None and write(Path(out), kind, seed, hidden):
            return
    raise RuntimeError(f"{kind} {seed}: nothing fits")
