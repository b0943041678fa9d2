# SPDX-License-Identifier: BSD-3-Clause
"""critic plan: which scripted experiments would decide a question, and how long that takes."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import ndtr

from kurumaisu import program, settings
from kurumaisu.critic.engine.catalogue import Candidate, Term, candidates, catalogue
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.experiment import design
from kurumaisu.critic.experiment.design import drives
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.values.policy import NAMED
from kurumaisu.errors import Error, failed
from kurumaisu.experiments import Script
from kurumaisu.names import hint
from kurumaisu.params import Model, load_model, shipped
from kurumaisu.types import FloatArray

_POWER = 0.95  # of the drives of that length decide
# [nat] log evidence beyond which p >= NAMED between two explanations that were equally probable
_ENOUGH = math.log(NAMED / (1 - NAMED))

Cause = tuple[tuple[Term, ...], FloatArray]  # its terms and their values


@dataclass(frozen=True)
class Row:
    """An experiment: expected log evidence of one run [nat], chance that one run decides, time that will do [s].

    rival: the effect that could most nearly stand in for the one asked for, and the evidence [nat] against it.
    """

    script: Script
    nats: float
    power: float
    seconds: float
    rival: tuple[str, float] | None


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 0, or 1 for a question that cannot be asked."""
    options = _parser().parse_args(arguments)
    try:
        model = load_model(options.model)
        question = options.between or [options.detect]
        causes = [cause(model, text) for text in question]
        print(table(question, plan(model, noise(), causes)))
    except Error as error:
        return failed("critic plan", error)
    return 0


def noise() -> Noise:
    """Return the noise to plan with, launch/rehearsal.yaml. Raise Error naming file and key."""
    top = settings.load(shipped("launch/rehearsal.yaml"))
    rates, reference = top.section("noise"), top.section("reference")
    white = {name: reference.number(name, above=0) for name in ("position_sd", "heading_sd")}
    found = Noise(**white, **{name: rates.number(name, above=0) for name in ("sd_v", "sd_lateral", "sd_w", "tau")})
    rates.end()
    return found


def cause(model: Model, text: str) -> Cause:
    """Return the terms of the effect `ID` with its typical size, or that of `ID=SIZE`, its first parameter.

    Raise Error for an id that the critic does not look for, and for a size that is none.
    """
    name, _, size = text.partition("=")
    ways = candidates(catalogue(model), model)
    chosen = max((way for way in ways if way.id == name), key=lambda way: len(way.terms), default=None)
    if chosen is None:
        raise Error(f"{name!r} is no effect on the base; {hint(name, (way.id for way in ways), 'docs/effects.md')}")
    values = np.array([_typical(term) for term in chosen.terms])
    if size:
        values[0] = _size(text, size, chosen)
        values[1:] = [term.null for term in chosen.terms[1:]]
    return chosen.terms, values


def _size(text: str, size: str, chosen: Candidate) -> float:
    try:
        value = float(size)
    except ValueError as error:
        raise Error(f"{text!r}: the size must be a number") from error
    p = chosen.terms[0].parameter
    if not p.lower <= value <= p.upper:
        raise Error(f"{text!r}: {p.name} must be {p.lower:g} to {p.upper:g} {p.unit}")
    return value


def plan(model: Model, assumed: Noise, causes: Sequence[Cause]) -> list[Row]:
    """Return the experiments, the quickest first: one cause against nothing, or one against another, either way."""
    rows = [_row(script, model, assumed, causes) for script in drives() if design.possible(script, model)]
    return sorted(rows, key=lambda row: (row.seconds, -row.nats))


def table(question: Sequence[str], rows: Sequence[Row]) -> str:
    """Return the rows for a terminal."""
    what = " or ".join(question) if len(question) > 1 else f"{question[0]}, or nothing"
    head = f"{'experiment':24} {'one run [s]':>11} {'[nat]':>8} {'decides':>8} {'needs [s]':>10}  nearest rival [nat]"
    lines = [f"Which drive tells {what}?", head]
    for row in rows:
        needs = f"{row.seconds:10.0f}" if math.isfinite(row.seconds) else f"{'never':>10}"
        rival = "" if row.rival is None else f"  {row.rival[0]} {row.rival[1]:.1f}"
        lines.append(f"{row.script.name:24} {row.script.seconds:11.0f} {row.nats:8.1f} {row.power:8.2f} {needs}{rival}")
    lines.append(f"decides: chance that one run makes p >= {NAMED:g}; needs: time after which {_POWER:.0%} have.")
    return "\n".join(lines)


def _row(script: Script, model: Model, assumed: Noise, causes: Sequence[Cause]) -> Row:
    drive = design.planned(script, model, ())
    # An effect with a threshold shows by a whole step of its typical size, if at all.
    terms = tuple(replace(term, step=1.0) for term in catalogue(model))
    problem = Problem([drive], model, assumed, terms)
    silent, slopes = problem.linearised((), np.empty(0), terms)
    signals = [silent - problem.residual(*one) for one in causes]

    def against(signal: FloatArray, names: frozenset[str]) -> float:
        use = [i for i, term in enumerate(terms) if term.id in names]
        return design.left_over(signal, slopes[:, use], design.prior([terms[i] for i in use]))

    ids = [frozenset(term.id for term in acting) for acting, _ in causes]
    nats, rival = against(signals[0], frozenset()), None
    if len(causes) == 1:
        others = {term.id for term in terms} - ids[0]
        rival = min(((name, against(signals[0], frozenset([name]))) for name in others), key=lambda pair: pair[::-1])
    else:
        nats = min(against(signals[0], ids[1]), against(signals[1], ids[0]))
    return Row(script, nats, power(nats), script.seconds * repeats(nats), rival)


def power(nats: float) -> float:
    """Return the chance that a drive decides whose log evidence is expected to be so much, and so scatters by 2 of it.

    The log evidence of two Gaussian predictions is Gaussian with a variance of twice its mean.
    """
    return float(ndtr((nats - _ENOUGH) / math.sqrt(2 * nats))) if nats > 0 else 0.0


def repeats(nats: float) -> float:
    """Return how many runs make it _POWER likely that they decide; infinity where none would."""
    if nats < design.NOTHING:
        return math.inf
    return next(n for n in range(1, 10_000) if power(n * nats) >= _POWER)


def _typical(term: Term) -> float:
    """Return the value of a term that stands for its effect's usual size."""
    if term.fixed:
        return term.parameter.lower
    size = term.null + term.parameter.scale
    return size if size <= term.parameter.upper else term.null - term.parameter.scale


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(prog="critic plan", description="Which experiments would decide, and how fast.")
    question = parser.add_mutually_exclusive_group(required=True)
    question.add_argument("--between", nargs=2, metavar=("ID[=SIZE]", "ID[=SIZE]"), help="which of two effects acts")
    question.add_argument("--detect", metavar="ID[=SIZE]", help="whether an effect of that size acts at all")
    parser.add_argument("--model", type=Path, default=shipped("launch/md100.yaml"), help="model file of the chair")
    return parser
