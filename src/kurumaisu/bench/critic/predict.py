# SPDX-License-Identifier: BSD-3-Clause
"""Whether predictions of withheld motion keep what their intervals promise, and how far they are from an oracle's."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import geometry
from kurumaisu.bench.hidden import Ask, Case, make, names_of
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.bench.table import Table, share
from kurumaisu.critic import pipeline
from kurumaisu.critic.base.drive import Drive, prepare_all
from kurumaisu.critic.predict.motion import motion_ahead
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.params import load_model, shipped
from kurumaisu.types import BoolArray, FloatArray

_HORIZONS = (0.2, 1.0, 5.0)  # [s]
_HELD = -1  # index of the run of which poses are withheld


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row per horizon: coverage of 90 % intervals per channel, and log densities against an oracle's."""
    parser = argparse.ArgumentParser(prog="scripts/bench predict", description=__doc__)
    parser.add_argument("--draws", type=int, default=20, help="recordings, each with one hidden effect")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--effects", nargs="+", default=(), help="ids that are hidden in turn; all of the base")
    options = parser.parse_args(arguments)
    names = [n for n in options.effects or names_of("single", "base") if n not in ("base.sign", "base.process_noise")]
    rows = [
        row
        for i in range(options.draws)
        for row in _of_draw(names[i % len(names)], options.seed + i)
        if row is not None
    ]
    title = f"{options.draws} recordings: withheld motion of one run of three"
    headings = ("dx covered      ", "dy covered      ", "dtheta covered  ", "nats           ", "oracle's nats")
    table = Table(title, "horizon [s]", "number", *headings)
    for horizon in _HORIZONS:
        some = [row for row in rows if abs(row.seconds - horizon) < 0.15 * horizon + 0.06]
        inside = np.array([row.inside for row in some])
        table.row(
            f"{horizon:g}",
            str(len(some)),
            *(share(int(inside[:, i].sum()), len(some)) for i in range(3)),
            float(np.mean([row.density for row in some])),
            float(np.mean([row.oracle for row in some])),
        )
    return 0


@dataclass(frozen=True)
class _Row:
    """One prediction: horizon [s], whether each channel lies in its interval, log density here and by the oracle."""

    seconds: float
    inside: BoolArray
    density: float
    oracle: float


def _of_draw(name: str, seed: int) -> list[_Row]:
    case = make(Ask("single", (name,)), seed)
    recording, truth = _withheld(case.recording, np.random.default_rng([seed, 50]))
    found = pipeline.criticise(recording, shipped("launch/md100.yaml"), lambda _: None)
    rows = []
    for one, measured, oracle in zip(found.predictions, truth, _oracle(case, recording.runs[_HELD]), strict=True):
        inside = np.abs(_off(measured, one.means)) < NORMAL90 * one.sds
        density = _density(_off(measured, one.means), one.sds)
        rows.append(_Row(one.t1 - one.t0, inside, density, _density(_off(measured, oracle[0]), oracle[1])))
    return rows


def _off(measured: FloatArray, mean: FloatArray) -> FloatArray:
    off = measured - mean
    off[2] = geometry.wrap(off[2])
    return np.asarray(off)


def _density(off: FloatArray, sds: FloatArray) -> float:
    return float(np.mean(-0.5 * (off / sds) ** 2 - np.log(sds) - 0.5 * np.log(2 * np.pi)))


def _withheld(recording: Recording, rng: np.random.Generator) -> tuple[Recording, FloatArray]:
    """Return the recording with a test run that lacks poses in stretches, and what was measured over each, (q, 3)."""
    run = recording.runs[_HELD]
    assert run.pose is not None
    t, poses = run.pose.t, run.pose.values
    keep, queries, truth = np.ones(len(t), dtype=bool), [], []
    i = int(np.searchsorted(t, 3.0))
    while True:
        j = i + max(1, round(float(rng.choice(_HORIZONS)) / float(t[1] - t[0])))
        if j >= len(t):
            break
        queries.append((t[i], t[j]))
        truth.append(geometry.between(poses[i], poses[j]))
        keep[i + 1 : j + 1] = False
        i = j + int(rng.integers(1, 15))
    test = replace(run, pose=Series(t[keep], poses[keep], run.pose.columns), queries=np.array(queries))
    train = tuple(name for name in recording.train if name != run.name)
    return replace(recording, runs=(*recording.runs[:_HELD], test), train=train, test=(run.name,)), np.array(truth)


def _oracle(case: Case, run: Run) -> list[tuple[FloatArray, FloatArray]]:
    """Return the oracle's means and sds: the increments to be expected by the generator, and its noise."""
    assert case.known is not None
    assert run.queries is not None
    whole = case.recording.runs[_HELD].pose
    assert whole is not None
    drive = prepare_all(run, load_model(shipped("launch/md100.yaml")), float(run.queries.max()))
    times, poses, noise = whole.t, case.known.poses[_HELD], noise_of(case.known.regime)

    def expected(_: Drive, at: FloatArray, past: Sequence[int]) -> tuple[FloatArray, list[FloatArray]]:
        """Return where somebody who knows what is hidden expects the chair."""
        return geometry.interpolate(times, poses, at), []

    made = [motion_ahead(drive, expected, noise, t0, t1) for t0, t1 in run.queries.tolist()]
    return [(mean, np.sqrt(np.diag(covariance))) for mean, covariance in made]
