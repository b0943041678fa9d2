# SPDX-License-Identifier: BSD-3-Clause
"""All that the critic must reach, in one table: each figure with its interval and floor, simple critics beside it."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.critic.by_effect import Answers, Job, all_answers
from kurumaisu.bench.hidden import Ask, names_of
from kurumaisu.bench.hidden.baselines import BASELINES
from kurumaisu.bench.hidden.score import SURE, Score, calibration_error
from kurumaisu.bench.table import Table, share

_NAMELESS = 10  # recordings of a kind whose cases have no name of their own, for one of those that have
_NAMED_SURELY = 0.9  # probability from which a wrong name counts where nothing of the catalogue is hidden


@dataclass(frozen=True)
class Part:
    """Recordings of one kind: of a family, in the catalogue's equations ('plain') or others."""

    kind: str
    family: str
    form: str = "other"

    def jobs(self, draws: int, seed: int, *, baselines: bool) -> Iterator[Job]:
        """Yield the draws of each name there is, or as many times `_NAMELESS` where there is none."""
        named = self.kind in ("single", "unknown", "wrong", "confounded")
        asked = [(name,) for name in names_of(self.kind, self.family)] if named else [()] * _NAMELESS
        for i, ids in enumerate(ids for ids in asked for _ in range(draws)):
            yield Job(Ask(self.kind, ids, form=self.form, family=self.family), seed + i, baselines)


BASE, LASER = Part("single", "base"), Part("single", "laser")
PLAIN_BASE, PLAIN_LASER = Part("single", "base", "plain"), Part("single", "laser", "plain")
SINGLES = (PLAIN_BASE, BASE, PLAIN_LASER, LASER)


@dataclass(frozen=True)
class Figure:
    """A row: what it is, its floor in words, the recordings it is of, and how it is counted."""

    label: str
    floor: str
    parts: tuple[Part, ...]
    count: Callable[[Sequence[Score]], str]
    compared: bool = False  # simple critics can be counted so, too


def _share(hit: Callable[[Score], bool], of: Callable[[Score], bool] = lambda _: True) -> Callable[..., str]:
    def count(scores: Sequence[Score]) -> str:
        chosen = [one for one in scores if of(one)]
        return f"{share(sum(map(hit, chosen)), len(chosen))} of {len(chosen)}"

    return count


def _right(one: Score) -> bool:
    return one.right


def _strong(one: Score) -> bool:
    return one.truth.strong


def _is_misnamed_surely(one: Score) -> bool:
    return any(p >= _NAMED_SURELY and not right for p, right in one.stated)


def _is_answered_surely(one: Score) -> bool:
    return any(p >= SURE and right for p, right in one.stated)


def _gain(q: float) -> Callable[[Sequence[Score]], str]:
    def count(scores: Sequence[Score]) -> str:
        gained = [one.gain_share for one in scores if one.gain_share is not None and one.truth.z >= 10]
        return f"{np.quantile(gained, q):.3f} of {len(gained)}" if gained else "-"

    return count


def _coverage(scores: Sequence[Score]) -> str:
    covered = [hit for one in scores for hit in one.covered]
    return f"{share(sum(covered), len(covered))} of {len(covered)}"


def _stated(scores: Sequence[Score]) -> list[tuple[float, bool]]:
    return [pair for one in scores for pair in one.stated]


def _calibration(scores: Sequence[Score]) -> str:
    return f"{calibration_error(_stated(scores)):.3f} of {len(_stated(scores))}"


def _sure(scores: Sequence[Score]) -> str:
    sure = [right for p, right in _stated(scores) if p >= SURE]
    return f"{share(sum(sure), len(sure))} of {len(sure)}"


def _of(kind: str, label: str, floor: str, count: Callable[[Sequence[Score]], str], compared: bool) -> list[Figure]:
    return [
        Figure(f"{label}, {family}", floor, (Part(kind, family),), count, compared and family == "base")
        for family in ("base", "laser")
    ]


FIGURES = (
    *_of("null", "false alarms", "<= 0.03", _share(lambda one: not one.nothing), compared=True),
    Figure("one cause exact, base, strong", ">= 0.95", (PLAIN_BASE,), _share(_right, _strong), compared=True),
    Figure("one cause exact, laser, strong", ">= 0.95", (PLAIN_LASER,), _share(_right, _strong)),
    Figure("another form, base, strong", ">= 0.90", (BASE,), _share(_right, _strong), compared=True),
    Figure("another form, laser, strong", ">= 0.90", (LASER,), _share(_right, _strong)),
    Figure("another form, base, any z", "", (BASE,), _share(_right), compared=True),
    Figure("another form, laser, any z", "", (LASER,), _share(_right)),
    *_of("pair", "pairs exact", ">= 0.90", _share(_right), compared=True),
    Figure("triples exact, base", ">= 0.80", (Part("triple", "base"),), _share(_right), compared=True),
    *_of("unknown", "unknown: flagged", ">= 0.95", _share(lambda one: one.unknown), compared=False),
    *_of("unknown", "unknown: misnamed, p >= .9", "<= 0.03", _share(_is_misnamed_surely), compared=False),
    *_of("unknown", "unknown: covariate found", ">= 0.95", _share(lambda one: one.followed), compared=False),
    *_of("confounded", "confounded: right set", ">= 0.95", _share(_right), compared=False),
    *_of("wrong", "wrong data recognised", ">= 0.95", _share(_right), compared=False),
    Figure("gain of the oracle's, median", ">= 0.97", (PLAIN_BASE, BASE), _gain(0.5)),
    Figure("gain of the oracle's, 10 %", ">= 0.85", (PLAIN_BASE, BASE), _gain(0.1)),
    Figure("90 % intervals, plain form", "0.85-0.95", (PLAIN_BASE, PLAIN_LASER), _coverage),
    Figure("90 % intervals, another form", "0.85-0.95", (BASE, LASER), _coverage),
    Figure("calibration error of p", "<= 0.04", SINGLES, _calibration),
    Figure("right when p >= .95", ">= 0.97", SINGLES, _sure),
    Figure("share answered so", ">= 0.75", SINGLES, _share(_is_answered_surely)),
)


def run(options: argparse.Namespace) -> int:
    """Make all recordings, and print the table."""
    answers: dict[Part, list[Answers]] = {}
    parts = dict.fromkeys(part for figure in FIGURES for part in figure.parts)
    for part in parts:
        print(f"{part.kind}, {part.family}, {part.form} form ...", flush=True)
        compared = any(figure.compared and part in figure.parts for figure in FIGURES)
        jobs = list(part.jobs(options.draws, options.seed, baselines=compared))
        answers[part] = all_answers(jobs, options.jobs, options.log)
    title = f"{options.draws} draws; shares with 90 % intervals, and of how many"
    table = Table(title, "figure", "floor    ", *(f"{who:<24}" for who in ("critic", *BASELINES)))
    for figure in FIGURES:
        table.row(figure.label, figure.floor, *(f"{cell:<24}" for cell in _cells(figure, answers)))
    return 0


def _cells(figure: Figure, answers: dict[Part, list[Answers]]) -> list[str]:
    of = [answer for part in figure.parts for answer in answers[part]]
    others = [figure.count([a[who] for a in of]) if figure.compared else "" for who in BASELINES]
    return [figure.count([a["critic"] for a in of]), *others]
