# SPDX-License-Identifier: BSD-3-Clause
"""The critic and simple baselines on hidden faults of one kind, effect by effect."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import repeat
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kurumaisu.bench.hidden import Ask, make, names_of
from kurumaisu.bench.hidden.baselines import BASELINES
from kurumaisu.bench.hidden.oracle import gain_share
from kurumaisu.bench.hidden.score import SURE, Score, calibration_error, score, scored_names
from kurumaisu.bench.processes import cpu_time
from kurumaisu.bench.table import Table, share
from kurumaisu.critic import pipeline
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.errors import Error
from kurumaisu.params import shipped

KINDS = {
    "base": ("single", "base"),
    "laser": ("single", "laser"),
    "pairs": ("pair", "base"),
    "triples": ("triple", "base"),
    "laser-pairs": ("pair", "laser"),
    "unknown": ("unknown", "base"),
    "laser-unknown": ("unknown", "laser"),
    "wrong": ("wrong", "base"),
    "laser-wrong": ("wrong", "laser"),
    "confounded": ("confounded", "base"),
    "laser-confounded": ("confounded", "laser"),
    "null": ("null", "base"),
    "laser-null": ("null", "laser"),
}
RIGHT = {
    "single": "exact set",
    "pair": "exact set",
    "triple": "exact set",
    "null": "nothing named",
    "unknown": "right covariate in the first three, nothing named",
    "wrong": "invalid_data, or the id that says the same",
    "confounded": "a set with the truth, of ids that all explain it",
}

Answers = dict[str, Score]  # to one recording, by who answers: "critic", and the baselines


@dataclass(frozen=True)
class Job:
    """One draw: what is asked for, its seed, and whether the baselines answer, too."""

    ask: Ask
    seed: int
    baselines: bool


def options_of(parser: argparse.ArgumentParser) -> None:
    """Add the options of this table."""
    parser.add_argument("--kind", choices=sorted(KINDS), help="what is hidden; without it all kinds, with the floors")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--log", type=Path, help="file for one JSON line per draw: truth and answer")
    one = parser.add_argument_group("with --kind only")
    one.add_argument("--effects", nargs="+", default=(), help="ids, or names of unknown or wrong things; all")
    one.add_argument("--form", choices=("plain", "other"), help="equations that hide an id; other")
    one.add_argument("--z", type=float, help="whitened norm; without it log-uniform in 5 to 60")
    one.add_argument("--baselines", action="store_true", help="rows of the baselines, too (base only)")


def without_kind(options: argparse.Namespace) -> list[str]:
    """Return the options given that say nothing where the table is of all kinds."""
    given = {"--effects": options.effects, "--form": options.form, "--baselines": options.baselines}
    asked = [name for name, value in given.items() if value]
    return asked if options.z is None else [*asked, "--z"]


def run(options: argparse.Namespace) -> int:
    """Print the table of one kind. Raise Error for a name that this kind does not know."""
    kind, family = KINDS[options.kind]
    rows = tuple(options.effects) or (("",) if kind in ("null", "pair", "triple") else names_of(kind, family))
    asks = [Ask(kind, (name,) if name else (), options.z, options.form or "other", family=family) for name in rows]
    baselines = options.baselines and family == "base"
    jobs = [Job(ask, options.seed + i, baselines) for i, ask in enumerate(np.repeat(np.array(asks), options.draws))]
    answers = all_answers(jobs, options.jobs, options.log)
    headings = ("right           ", "misnamed        ", "confounded      ", "unknown         ", "nothing         ")
    title = f"{options.kind}; right: {RIGHT[kind]}; shares with 90 % intervals"
    table = Table(title, "hidden", "number", *headings, "interval covers ", "median z", "CPU [s]")
    scores: dict[str, list[Score]] = {}
    for answer in answers:
        for who, one in answer.items():
            scores.setdefault(who, []).append(one)
    for i, name in enumerate(rows):
        if name:
            _row(table, name, scores["critic"][i * options.draws : (i + 1) * options.draws])
    for who, all_of in scores.items():
        _row(table, f"all: {who}", all_of)
        if kind in ("pair", "triple"):
            _row(table, f"  each z >= 5 beside the others: {who}", [one for one in all_of if one.truth.shown])
        if kind in ("single", "pair", "triple"):
            hard = [one for one in all_of if one.truth.strong]
            _row(table, f"  each z >= 10, rival's z >= 6: {who}", hard)
    _summary(table, scores["critic"])
    return 0


def all_answers(jobs: Sequence[Job], processes: int, log: Path | None) -> list[Answers]:
    """Return the scores of all draws, in order; say on a terminal how far it is."""
    out: list[Answers] = []
    with TemporaryDirectory() as folder, ProcessPoolExecutor(processes) as pool:
        for job, answer in zip(jobs, pool.map(_answers, jobs, repeat(folder)), strict=True):
            out.append(answer)
            _log(log, [job], [answer])
            if sys.stderr.isatty():
                print(f"\r{len(out)} of {len(jobs)}", end="" if len(out) < len(jobs) else "\n", file=sys.stderr)
    return out


def _answers(job: Job, folder: str) -> Answers:
    """Return the scores of the critic and, if asked, of the baselines."""
    case = make(job.ask, job.seed, Path(folder))
    start = cpu_time()
    verdict = _criticised(case.recording)
    cpu = cpu_time() - start
    out = {"critic": replace(score(case.truth, verdict, cpu), gain_share=gain_share(case, verdict.gain))}
    for name, baseline in BASELINES.items() if job.baselines else ():
        start = time.process_time()
        named = baseline(case.recording)
        out[name] = scored_names(case.truth, named, time.process_time() - start)
    return out


def _criticised(recording: Recording) -> Verdict:
    try:
        return pipeline.criticise(recording, shipped("launch/md100.yaml"), lambda _: None).verdict
    except Error as error:
        return Verdict("invalid_data", problems=(str(error),))


def _row(table: Table, label: str, scores: Sequence[Score]) -> None:
    n = len(scores)
    covered = [hit for one in scores for hit in one.covered]
    flags = ("right", "misnamed", "confounded", "unknown", "nothing")
    table.row(
        label,
        str(n),
        *(share(sum(getattr(one, flag) for one in scores), n) for flag in flags),
        share(sum(covered), len(covered)),
        float(np.median([one.truth.z for one in scores])) if scores else float("nan"),
        float(np.median([one.cpu for one in scores])) if scores else float("nan"),
    )


def _summary(table: Table, scores: Sequence[Score]) -> None:
    stated = [pair for one in scores for pair in one.stated]
    sure = [right for p, right in stated if p >= SURE]
    table.note(
        f"Of {len(stated)} causes named: calibration error {calibration_error(stated):.3f}; "
        f"right when p >= {SURE}: {share(sum(sure), len(sure))}, {len(sure)} of them."
    )
    gained = [one.gain_share for one in scores if one.gain_share is not None and one.truth.z >= 10]
    if gained:
        low, middle = np.quantile(gained, [0.1, 0.5])
        table.note(
            f"Gain on data held out, as a share of the oracle's, z >= 10: median {middle:.3f}, "
            f"10 % quantile {low:.3f}, of {len(gained)}."
        )


def _log(path: Path | None, jobs: Sequence[Job], answers: Sequence[Answers]) -> None:
    if path is None:
        return
    with path.open("a", encoding="utf-8") as stream:
        for line in _lines(jobs, answers):
            stream.write(line + "\n")


def _lines(jobs: Sequence[Job], answers: Sequence[Answers]) -> Iterator[str]:
    for job, answer in zip(jobs, answers, strict=True):
        one = answer["critic"]
        truth = {key: value for key, value in asdict(one.truth).items() if value}
        yield json.dumps(
            {"seed": job.seed, "right": one.right, "answer": one.words, "gain_share": one.gain_share, "truth": truth}
        )
