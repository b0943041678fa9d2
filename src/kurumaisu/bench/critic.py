# SPDX-License-Identifier: BSD-3-Clause
"""How often the critic names a hidden effect, misnames it, or raises a false alarm; and what that costs."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench import critic_table, hidden_effect
from kurumaisu.bench.hidden_effect import Disturbance
from kurumaisu.bench.table import Table, share
from kurumaisu.critic import pipeline
from kurumaisu.critic.recording import Recording, Run, Series
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

_RUNS = 3
_SIZES = (0.1, 0.3, 1.0)  # of the sizes that hidden_effect draws


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; every draw has its own seed, size and drives.

    Without --kind nine effects of the base in three sizes; with it what is asked for, hidden by bench/hidden.
    """
    parser = argparse.ArgumentParser(prog="bench critic")
    parser.add_argument("--draws", type=int, default=4, help="recordings per effect and size; 0: none")
    parser.add_argument("--nulls", type=int, default=20, help="recordings without an effect, per kind of noise")
    parser.add_argument("--seed", type=int, default=1000)
    critic_table.options_of(parser)
    options = parser.parse_args(arguments)
    if options.kind:
        return critic_table.run(options)
    rng = np.random.default_rng(options.seed)
    title = f"{_RUNS} drives of 60 s, reference at 10 Hz; share (90 % interval) of the recordings"
    headings = ("named right     ", "misnamed        ", "a set           ", "nothing         ", "interval covers ")
    table = Table(title, "hidden effect, size", "number", *headings, "CPU [s]")
    for effect in hidden_effect.EFFECTS:
        for size in _SIZES if options.draws else ():
            draws = [_draw(effect, size, rng, hidden_effect.USUAL) for _ in range(options.draws)]
            _row(table, f"{effect} x {size:g}", effect, draws)
    for name, disturbance in hidden_effect.DISTURBANCES.items():
        _row(table, f"nothing, {name}", None, [_draw(None, 0.0, rng, disturbance) for _ in range(options.nulls)])
    return 0


def recording(
    effect: str | None, size: float, seed: int, seconds: float, disturbance: Disturbance = hidden_effect.USUAL
) -> Recording:
    """Return a recording of several runs with a hidden effect, or none."""
    tables = [hidden_effect.make_run(effect, size, seed * _RUNS + i, seconds, disturbance) for i in range(_RUNS)]
    return recording_of(f"hidden {seed}", tables)


def recording_of(name: str, drives: Sequence[dict[str, FloatArray]]) -> Recording:
    """Return a recording of the tables of some drives."""
    runs = tuple(
        Run(
            f"run_{i}",
            command=Series.of_table(tables["command"], "v", "w"),
            voltage=Series.of_table(tables["voltage"], "v_f", "v_s"),
            pose=Series.of_table(tables["pose"], "x", "y", "theta"),
        )
        for i, tables in enumerate(drives, start=1)
    )
    return Recording(name, runs, train=tuple(run.name for run in runs))


@dataclass(frozen=True)
class _Draw:
    """verdict, and causes by id; covered: the hidden effect's 90 % interval holds its size, None where not named."""

    verdict: str
    named: frozenset[str]
    covered: bool | None
    cpu: float


def _draw(effect: str | None, share: float, rng: np.random.Generator, disturbance: Disturbance) -> _Draw:
    size = share * hidden_effect.draw_size(effect, rng) if effect else 0.0
    data = recording(effect, size, int(rng.integers(1, 2**31)), 60.0, disturbance)
    start = time.process_time()
    verdict = pipeline.criticise(data, shipped("launch/md100.yaml"), lambda _: None).verdict
    causes = verdict.causes
    cpu = time.process_time() - start
    estimates = [estimate for cause in causes if cause.id == effect for estimate in cause.parameters.values()]
    covered = estimates[0].lo90 <= size <= estimates[0].hi90 if estimates else None
    return _Draw(verdict.verdict, frozenset(cause.id for cause in causes), covered, cpu)


def _row(table: Table, label: str, effect: str | None, draws: Sequence[_Draw]) -> None:
    right = sum(draw.named == {effect} for draw in draws)
    wrong = sum(bool(draw.named - {effect}) for draw in draws)
    a_set = sum(draw.verdict == "confounded" for draw in draws)
    n = len(draws)
    covered = [draw.covered for draw in draws if draw.covered is not None]
    table.row(
        label,
        str(n),
        *(share(k, n) for k in (right, wrong, a_set, n - right - wrong - a_set)),
        share(sum(covered), len(covered)),
        float(np.median([draw.cpu for draw in draws])),
    )
