# SPDX-License-Identifier: BSD-3-Clause
"""The critic on recordings by generators whose authors have not seen it: one table of figures with their floors."""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

from kurumaisu.bench.hidden.score import SURE, calibration_error
from kurumaisu.bench.processes import cpu_time
from kurumaisu.bench.table import Table
from kurumaisu.critic import pipeline
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.criticism import Criticism, Prediction
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.errors import Error
from kurumaisu.params import shipped

GENERATORS = ("scree", "loess", "fell", "quay")  # the first two to report on
KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")
_Z, _BESIDE, _BESIDE_OTHERS = 10.0, 6.0, 4.0  # what a case must show to count
_NAMED = 0.9
_STRAY = 8.0  # sds off what the true causes predict, from which an answer is none of them
_Q = 0.5  # [nat] by which the answers must be worse than the model's own to be told so, for each query


@dataclass(frozen=True)
class Case:
    """One recording: what its author hid, what was said, what queries gained as a share of the oracle's, CPU [s].

    worse: what was found predicts worse than the model without it; proposed: what to drive next was said, or why no
    drive can tell.
    """

    truth: Mapping[str, Any]
    verdict: Verdict | None
    gain: float | None
    worse: bool
    cpu: float
    proposed: bool = False

    @property
    def ids(self) -> set[str]:
        """Return the causes that act."""
        return {cause["id"] for cause in self.truth["causes"]}

    @property
    def named(self) -> set[str]:
        """Return the causes that were named, but for what is neutral where it is not hidden."""
        causes = self.verdict.causes if self.verdict is not None else ()
        return {cause.id for cause in causes if cause.p >= _NAMED} - (set(self.truth["neutral"]) - self.ids)

    @property
    def right(self) -> bool:
        """Tell whether the answer is what the kind of case calls for."""
        verdict, kind = self.verdict, str(self.truth["kind"])
        if verdict is None:
            return kind == "wrong"
        if kind == "wrong":
            return verdict.verdict == "invalid_data"
        if kind == "unknown":
            return verdict.verdict == "unknown"
        if kind == "confounded":
            return any(self.ids & set(group) for group in verdict.confounded) or self.named == self.ids
        told = self.named == self.ids and not verdict.unknown and verdict.verdict != "invalid_data"
        return told and not (kind == "null" and verdict.confounded)

    @property
    def strong(self) -> bool:
        """Tell whether what is hidden shows as clearly as the floors ask for."""
        least = {"single": _BESIDE, "form": _BESIDE, "confounded": 0.0}.get(self.truth["kind"], _BESIDE_OTHERS)
        return all(cause["z"] >= _Z and cause["beside"] >= least for cause in self.truth["causes"])

    @property
    def followed(self) -> bool:
        """Tell whether one of the first three curves is over what the unknown follows."""
        names = (self.truth["unknown"] or {}).get("covariates", ())
        accepted = [name.replace("since_change", "since_command") for name in names]
        said = [_as_strangers_say(one.covariate) for one in self.verdict.unknown[:3]] if self.verdict else []
        return any(name in said or f"time_{name}" in said or f"distance_{name}" in said for name in accepted)


@dataclass(frozen=True)
class Job:
    """A recording to make and to criticise."""

    generator: str
    kind: str
    seed: int
    folder: Path


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table of some generators."""
    parser = argparse.ArgumentParser(prog="scripts/bench strangers", description=__doc__)
    parser.add_argument("--generators", nargs="+", choices=GENERATORS, default=GENERATORS[:2])
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--draws", type=int, default=20, help="recordings of each kind")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--folder", type=Path, default=Path("out/strangers"), help="where the recordings are kept")
    parser.add_argument("--cases", action="store_true", help="a line for each recording")
    options = parser.parse_args(arguments)
    seeds = range(options.seed, options.seed + options.draws)
    jobs = [
        Job(generator, kind, seed, options.folder)
        for seed in seeds
        for generator in options.generators
        for kind in options.kinds
    ]
    cases: dict[str, list[Case]] = {generator: [] for generator in options.generators}
    with ProcessPoolExecutor(options.jobs) as pool:
        for job, case in zip(jobs, pool.map(_case, jobs), strict=True):
            if case is None:
                print(f"{job.generator}/{job.kind}-{job.seed}: could not be made")
                continue
            cases[job.generator].append(case)
            if options.cases:
                print(
                    f"{'ok   ' if case.right else 'WRONG'} {job.generator}/{job.kind}-{job.seed}: {_words(case)}",
                    flush=True,
                )
            elif sys.stderr.isatty():
                print(f"\r{sum(map(len, cases.values()))} of {len(jobs)}", end="", file=sys.stderr)
    table = Table("The critic, with exact 95 % intervals", "figure", "floor     ", *(f"{name:>24}" for name in cases))
    for rows in zip(*map(_rows, cases.values()), strict=True):
        table.row(*rows[0][:2], *(value for _, _, value in rows))
    return 0


def _case(job: Job) -> Case | None:
    """Make a recording if it is not there, and criticise it; None where its author's program finds no such case."""
    where = job.folder / job.generator / f"{job.kind}-{job.seed}"
    if not (where / "truth.json").exists():
        where.mkdir(parents=True, exist_ok=True)
        try:
            import_module(f"kurumaisu.bench.strangers.{job.generator}").make(where, job.kind, job.seed)
        except RuntimeError:
            return None
    truth = json.loads((where / "truth.json").read_text(encoding="utf-8"))
    start = cpu_time()
    try:
        recording = read_recording(where / "recording")
        model = recording.model or shipped("launch/md100.yaml")
        found = pipeline.criticise(recording, model, lambda _: None)
    except Error:
        return Case(truth, None, None, worse=False, cpu=cpu_time() - start)
    cpu, worse = cpu_time() - start, False
    ours, base, oracle = _densities(where / "answers.csv", found)
    if job.kind == "null":  # by our own predictor: the author's knows the true noise
        bare = pipeline.criticise(recording, model, lambda _: None, ids=frozenset())
        worse = ours < _densities(where / "answers.csv", bare)[0] - _Q * len(found.predictions)
    gain = (ours - base) / (oracle - base) if oracle - base > 1.0 else None
    proposed = found.verdict.next_experiment is not None or bool(found.story.next_drive)
    return Case(truth, found.verdict, gain, worse, cpu, proposed)


def _densities(path: Path, found: Criticism) -> tuple[float, float, float]:
    """Return the log density [nat] of what queries ask for by the critic, by the model, and by the true causes."""
    said = {key: value for prediction in found.predictions for key, value in _said(prediction)}
    model = oracle = ours = 0.0
    with path.open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            times = round(float(row["t0"]), 3), round(float(row["t1"]), 3)
            key = row["run"], row["channel"], *times, int(row["beam"] or -1)
            mean, sd = said.get(key, (np.nan, np.nan))
            value = float(row["value"])
            stray = abs(value - float(row["oracle_mean"])) > _STRAY * float(row["oracle_sd"])  # one would decide all
            if np.isfinite(mean) and np.isfinite(sd) and not stray:
                model += _density(value, float(row["base_mean"]), float(row["base_sd"]))
                oracle += _density(value, float(row["oracle_mean"]), float(row["oracle_sd"]))
                ours += _density(value, mean, sd)
    return ours, model, oracle


def _said(prediction: Prediction) -> Iterator[tuple[tuple[str, str, float, float, int], tuple[float, float]]]:
    """Yield run, channel, times and beam, as answers.csv has them, with mean and sd."""
    run, t0, t1 = prediction.run, round(prediction.t0, 3), round(prediction.t1, 3)
    for i, (mean, sd) in enumerate(zip(prediction.means.tolist(), prediction.sds.tolist(), strict=True)):
        channel, beam = ("range", i) if prediction.is_scan else (("dx", "dy", "dtheta")[i], -1)
        yield (run, channel, t0, t1, beam), (mean, sd)


def _density(value: float, mean: float, sd: float) -> float:
    return -0.5 * ((value - mean) / sd) ** 2 - float(np.log(sd))


def _as_strangers_say(covariate: str) -> str:
    """Return what the generators call what the critic calls so."""
    plain = covariate.replace("|", "abs_", 1).replace("|", "").replace("world bearing", "direction")
    return plain.replace("hit ", "hit_")


def _share(hit: Callable[[Case], bool], cases: Sequence[Case]) -> str:
    """Return a share with its exact 95 % interval."""
    n, k = len(cases), sum(map(hit, cases))
    if not n:
        return "-"
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    return f"{k / n:.2f} ({low:.2f}-{high:.2f}) of {n}"


def _rows(cases: Sequence[Case]) -> Iterator[tuple[str, str, str]]:
    """Yield figures with their floors and values."""
    of = {kind: [case for case in cases if case.truth["kind"] == kind] for kind in KINDS}
    strong = {kind: [case for case in of[kind] if case.strong] for kind in KINDS}
    right = partial(_share, lambda case: case.right)
    yield "alarms on nulls", "<= .03", _share(lambda case: not case.right, of["null"])
    for kind, floor in (("single", ">= .92"), ("form", ">= .88"), ("pair", ">= .88"), ("triple", ">= .80")):
        yield f"{kind}: right", floor, right(strong[kind])
    yield "outside the catalogue: flagged", ">= .90", right(of["unknown"])
    yield "outside the catalogue: misnamed", "<= .05", _share(lambda case: bool(case.named), of["unknown"])
    yield "outside the catalogue: covariate", ">= .75", _share(lambda case: case.followed, of["unknown"])
    yield "confounded sets", ">= .93", right(strong["confounded"])
    sets = [case for case in cases if case.verdict is not None and case.verdict.confounded]
    yield "with the next experiment, or why none can tell", "all", _share(lambda case: case.proposed, sets)
    yield "wrong data recognised", ">= .95", right(of["wrong"])
    stated = [
        (cause.p, cause.id in case.ids)
        for case in cases
        if case.verdict
        for cause in case.verdict.causes
        if cause.id not in case.truth["neutral"]
    ]
    sure = [hit for p, hit in stated if p >= SURE]
    yield "right when p >= .95", ">= .97", f"{np.mean(sure):.2f} of {len(sure)}" if sure else "-"
    yield "calibration error", "<= .04", f"{calibration_error(stated):.3f}"
    held = list(_covered(cases))
    yield "90 % intervals hold the truth", ".85-.95", f"{np.mean(held):.2f} of {len(held)}" if held else "-"
    gains = [case.gain for case in strong["single"] + strong["form"] if case.gain is not None]
    yield "gain on queries: median", ">= .95", f"{np.median(gains):.2f} of {len(gains)}" if gains else "-"
    yield "gain on queries: lowest tenth", ">= .6", f"{np.quantile(gains, 0.1):.2f}" if gains else "-"
    yield "nulls predicted worse", "<= .05", _share(lambda case: case.worse, of["null"])
    yield "CPU [s], median and most", "", f"{np.median([c.cpu for c in cases]):.0f}, {max(c.cpu for c in cases):.0f}"


def _covered(cases: Sequence[Case]) -> Iterator[bool]:
    for case in cases:
        true = {cause["id"]: cause.get("parameters") or {} for cause in case.truth["causes"]}
        for cause in case.verdict.causes if case.verdict else ():
            for name, value in true.get(cause.id, {}).items():
                if name in cause.parameters:
                    yield cause.parameters[name].lo90 <= value <= cause.parameters[name].hi90


def _words(case: Case) -> str:
    hidden = " ".join(
        f"{c['id']}{'*' * (c['form'] == 'other')} (z {c['z']:.0f}/{c['beside']:.0f})" for c in case.truth["causes"]
    )
    hidden += f" {case.truth['unknown']}" if case.truth["unknown"] else f" {case.truth['wrong'] or ''}"
    if case.verdict is None:
        return f"{hidden} | refused | {case.cpu:.0f} s"
    said = " ".join(f"{cause.id} {cause.p:.2f}" for cause in case.verdict.causes)
    said += "".join(f" {{{', '.join(group)}}}" for group in case.verdict.confounded)
    said += "".join(f" ?{one.channel} over {one.covariate} {one.p:.2f}" for one in case.verdict.unknown)
    return f"{hidden} | {case.verdict.verdict} {said} | {case.cpu:.0f} s"
