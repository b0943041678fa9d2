# SPDX-License-Identifier: BSD-3-Clause
"""Does the proposed experiment decide? Causes that a drive confounds, by an independent generator, criticised twice."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import run_of
from kurumaisu.bench.hidden.generator.motion import STEP, Fault, Setting, drive
from kurumaisu.bench.hidden.generator.noise import USUAL, draw_rates, draw_reference
from kurumaisu.bench.table import Table, share
from kurumaisu.critic import pipeline
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.experiments import samples, shipped_script
from kurumaisu.experiments.timeline import PERIOD
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

_SECONDS = 60.0
_POSES = 0.1  # [s] between poses
_ROUNDS = 2  # experiments that are run, at most


def _steady(rng: np.random.Generator) -> tuple[float, float]:
    """Choose one forward speed, or rest."""
    return 0.4 * (rng.random() < 0.6), 0.0


def _slow(rng: np.random.Generator) -> tuple[float, float]:
    """Choose a crawl, or rest."""
    return 0.15 * (rng.random() < 0.6), 0.0


def _bends(rng: np.random.Generator) -> tuple[float, float]:
    """Choose a turn at one forward speed."""
    return 0.4, float(rng.choice([-0.4, 0.0, 0.4]))


@dataclass(frozen=True)
class Confounded:
    """Two causes, their sizes, and a drive that does not tell them apart."""

    causes: tuple[str, str]
    sizes: tuple[float, float]
    choose: Callable[[np.random.Generator], tuple[float, float]]


PAIRS = (
    Confounded(("base.lateral_slip", "base.marker_x"), (0.08, -0.032), _bends),
    Confounded(("base.lag_v", "base.accel_limit"), (0.12, 1.6), _slow),
    Confounded(("base.gain_v", "base.dead_zone_v"), (-0.1, 0.053), _steady),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="scripts/bench next_experiment", description=__doc__)
    parser.add_argument("--draws", type=int, default=10, help="recordings per cause")
    parser.add_argument("--seed", type=int, default=1000)
    options = parser.parse_args(arguments)
    title = f"A drive of {_SECONDS:g} s that confounds two causes; then what the critic proposed; share (90 % interval)"
    headings = ("named wrong at first", "a proposal       ", "then named right ", "misnamed         ")
    table = Table(title, "cause (or)", "number", *headings, "proposed", "CPU [s]")
    for pair in PAIRS:
        for i, cause in enumerate(pair.causes):
            draws = [tell(pair, i, options.seed + k) for k in range(options.draws)]
            _row(table, f"{cause} ({pair.causes[1 - i]})", draws)
    return 0


@dataclass(frozen=True)
class Draw:
    """What was named at first and at last, whether that is right, and the experiments proposed in between."""

    cause: str
    first: Verdict
    last: Verdict
    proposed: tuple[str, ...]
    cpu: float

    @property
    def right(self) -> bool:
        """Tell whether the cause, and it alone, is named at last."""
        return [cause.id for cause in self.last.causes] == [self.cause]


def tell(pair: Confounded, which: int, seed: int) -> Draw:
    """Return the story of one recording with one of a pair's causes hidden."""
    cause = pair.causes[which]
    rng = np.random.default_rng([seed, which])
    sizes = {**BASE[cause].draw(rng), "size": pair.sizes[which] * rng.uniform(0.7, 1.3)}
    fault = BASE[cause].fault(sizes, "plain")
    begin = time.process_time()
    recording = recording_of([_run("given", _commands(pair.choose, rng), fault, rng)])
    first = last = _criticise(recording)
    proposed: list[str] = []
    while last.next_experiment is not None and len(proposed) < _ROUNDS and not _done(last):
        script = shipped_script(last.next_experiment.id)
        proposed.append(script.name)
        more = _run(f"{script.name}_{len(proposed)}", samples(script.phases, PERIOD), fault, rng)
        recording = recording_of([*recording.runs, more])
        last = _criticise(recording)
    return Draw(cause, first, last, tuple(proposed), time.process_time() - begin)


def recording_of(runs: Sequence[Run]) -> Recording:
    """Return the recording of runs with a reference of known quality."""
    sd = (USUAL.position_sd, USUAL.heading_sd)
    return Recording("confounded", tuple(runs), train=tuple(run.name for run in runs), truth=sd)


def _done(verdict: Verdict) -> bool:
    return verdict.verdict == "named" and not verdict.confounded


def _criticise(recording: Recording) -> Verdict:
    return pipeline.criticise(recording, shipped("launch/md100.yaml"), lambda _: None).verdict


def _commands(choose: Callable[[np.random.Generator], tuple[float, float]], rng: np.random.Generator) -> FloatArray:
    times = np.cumsum(rng.uniform(1.0, 3.0, 100))
    times = np.concatenate([[0.0], times[times < _SECONDS]])
    return np.vstack([[[t, *choose(rng)] for t in times], [_SECONDS, 0.0, 0.0]])


def _run(name: str, command: FloatArray, fault: Fault, rng: np.random.Generator) -> Run:
    stamps = _POSES * np.arange(round((command[-1, 0] + 1.0) / _POSES))
    noise = draw_rates(USUAL, round((stamps[-1] + 3.0) / STEP), rng)
    setting = Setting(command, np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]), stamps, noise)
    poses, _ = drive(setting, (fault,))
    run = run_of(name, setting, poses + draw_reference(USUAL, stamps, rng))
    return replace(run, name=name)


def _row(table: Table, label: str, draws: Sequence[Draw]) -> None:
    n = len(draws)
    at_first = sum(bool({cause.id for cause in draw.first.causes} - {draw.cause}) for draw in draws)
    wrong = sum(bool({cause.id for cause in draw.last.causes} - {draw.cause}) for draw in draws)
    counts = (at_first, sum(bool(draw.proposed) for draw in draws), sum(draw.right for draw in draws), wrong)
    names = Counter(name for draw in draws for name in draw.proposed)
    said = ", ".join(f"{name} {count}" for name, count in names.most_common())
    table.row(label, str(n), *(share(k, n) for k in counts), said, float(np.median([draw.cpu for draw in draws])))
