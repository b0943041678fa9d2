# SPDX-License-Identifier: BSD-3-Clause
"""How often the critic names a hidden effect, misnames it, or raises a false alarm; and what that costs."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

from kurumaisu.bench import hidden_effect
from kurumaisu.bench.table import Table
from kurumaisu.critic import pipeline
from kurumaisu.critic.recording import Recording, Run, Series
from kurumaisu.critic.verdict import Verdict
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

_RUNS = 3
_SIZES = (0.1, 0.3, 1.0)  # of the sizes that hidden_effect draws


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; every draw has its own seed, size and drives."""
    parser = argparse.ArgumentParser(prog="bench critic")
    parser.add_argument("--draws", type=int, default=4, help="per effect and size")
    parser.add_argument("--seed", type=int, default=1000)
    options = parser.parse_args(arguments)
    rng = np.random.default_rng(options.seed)
    title = f"{_RUNS} drives of 60 s, reference 5 mm and 5 mrad at 10 Hz; share (90 % interval) of the draws"
    table = Table(
        title, "hidden effect, size", "draws", "named right     ", "misnamed        ", "none, or a set  ", "CPU [s]"
    )
    for effect in [*hidden_effect.EFFECTS, None]:
        for size in _SIZES if effect else (0.0,):
            draws = options.draws * (1 if effect else len(_SIZES) * 3)
            _row(table, effect, size, [_draw(effect, size, rng) for _ in range(draws)])
    return 0


def recording(effect: str | None, size: float, seed: int, seconds: float) -> Recording:
    """Return a recording of several runs with a hidden effect, or none."""
    names = tuple(f"run_{i + 1}" for i in range(_RUNS))
    runs = []
    for i, name in enumerate(names):
        tables = hidden_effect.make_run(effect, size, seed * _RUNS + i, seconds)
        runs.append(
            Run(
                name,
                command=_series(tables["command"], "v", "w"),
                voltage=_series(tables["voltage"], "v_f", "v_s"),
                pose=_series(tables["pose"], "x", "y", "theta"),
            )
        )
    return Recording(f"hidden {seed}", tuple(runs), train=names)


def _series(table: FloatArray, *columns: str) -> Series:
    return Series(table[:, 0], table[:, 1:], columns)


def _draw(effect: str | None, share: float, rng: np.random.Generator) -> tuple[Verdict, float]:
    size = share * hidden_effect.draw_size(effect, rng) if effect else 0.0
    data = recording(effect, size, int(rng.integers(1, 2**31)), 60.0)
    start = time.process_time()
    verdict = pipeline.criticise(data, shipped("launch/md100.yaml"), lambda _: None).verdict
    return verdict, time.process_time() - start


def _row(table: Table, effect: str | None, size: float, results: list[tuple[Verdict, float]]) -> None:
    named = [{cause.id for cause in verdict.causes} for verdict, _ in results]
    right = sum(ids == {effect} for ids in named)
    wrong = sum(bool(ids - {effect}) for ids in named)
    n = len(results)
    shares = [_share(k, n) for k in (right, wrong, n - right - wrong)]
    cpu = float(np.median([seconds for _, seconds in results]))
    table.row(f"{effect} x {size:g}" if effect else "nothing", str(n), *shares, cpu)


def _share(k: int, n: int) -> str:
    """Return a share with its exact (Clopper-Pearson) 90 % interval."""
    low = beta.ppf(0.05, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.95, k + 1, n - k) if k < n else 1.0
    return f"{k / n:.2f} ({low:.2f}-{high:.2f})"
