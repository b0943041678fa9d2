# SPDX-License-Identifier: BSD-3-Clause
"""What drives cannot show for lack of motion or time: said, with the scripted drive that supplies most of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.catalogue import SHOWS, Term, catalogue
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.experiment import design
from kurumaisu.critic.experiment.proposal import DECIDED
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.noise import base_noise
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.verdict import NextExperiment
from kurumaisu.experiments import Script
from kurumaisu.params import Model

_FEW = 0.5  # share of the catalogue below which what could be seen is too little to say that nothing is missing
_REST = 1e-3  # [m/s], [rad/s] inputs below are none
_SHORT = 15.0  # [s] in all: too little to tell effects from noise
_LISTED = 6


def with_shortcomings(
    criticism: Criticism, made: Decision, drives: Sequence[Drive], scripts: Sequence[Script]
) -> Criticism:
    """Return the criticism, and where nothing was found because little could show, what to drive for it."""
    if criticism.verdict.verdict != "none" or (made.something and made.found.enough):
        return criticism
    problem = made.problem
    ids = sorted({term.id for term in catalogue(problem.model, problem.ids)})
    unseen = [name for name in ids if name not in {candidate.id for candidate in problem.candidates}]
    if made.found.enough and len(unseen) <= _FEW * len(ids):
        return criticism
    wanted = unseen if made.found.enough else ids
    best = _supplier(problem.model, scripts, wanted)
    why = shortcomings(drives, enough=made.found.enough)
    listed = ", ".join(wanted[:_LISTED]) + (f" and {len(wanted) - _LISTED} more" if len(wanted) > _LISTED else "")
    some = f"None of the {len(ids)} effects can" if wanted == ids else f"{len(wanted)} of {len(ids)} effects cannot"
    verb = "detected" if made.found.enough else "named"
    sentence, headline = f"{some} be {verb} in this recording: {listed}.", f"{some} be {verb}, because {why}."
    next_drive = criticism.story.next_drive
    if best is not None:
        next_drive = (
            f"Run the experiment {best.id} ({best.seconds:.0f} s). It detects {len(best.separates)} of them at "
            f"their usual sizes."
        )
    story = replace(
        criticism.story,
        headline=headline,
        unexplained=(sentence, *criticism.story.unexplained),
        next_drive=next_drive,
        details=(*criticism.story.details, sentence, *([next_drive] if next_drive else [])),
    )
    return replace(criticism, story=story, verdict=replace(criticism.verdict, next_experiment=best))


def shortcomings(drives: Sequence[Drive], *, enough: bool) -> str:
    """Return in words what drives lack; enough: there are more data than the catalogue could fit."""
    ahead = max(float(np.abs(drive.v).max()) for drive in drives)
    turn = max(float(np.abs(drive.w).max()) for drive in drives)
    seconds = sum(float(drive.times[-1] - drive.times[0]) for drive in drives)
    if max(ahead, turn) < _REST:
        return "the chair was never commanded to move"
    if seconds < _SHORT:
        return f"only {seconds:.1f} s were recorded"
    if not enough:
        count = sum(len(drive.times) - 1 for drive in drives)
        return f"{count} intervals between poses are too few to tell effects from noise"
    if turn < _REST:
        return "the chair was never commanded to turn"
    if ahead < _REST:
        return "the chair was commanded only to turn, never to drive"
    return "the inputs hardly change"


def _supplier(model: Model, scripts: Sequence[Script], wanted: Sequence[str]) -> NextExperiment | None:
    """Return the script that shows most of these effects, the shorter one of two; None where none shows any."""
    terms = catalogue(model, frozenset(wanted))
    options = []
    for script in scripts:
        if design.possible(script, model):
            sizes = _sizes(Problem([design.planned(script, model, ())], model, base_noise.START, ()), terms)
            shown = tuple(name for name in wanted if sizes[name] >= SHOWS)
            nats = float(np.mean([min(0.5 * sizes[name] ** 2, DECIDED) for name in wanted]))
            options.append((len(shown), -script.seconds, NextExperiment(script.name, script.seconds, nats, shown)))
    best = max(options, key=lambda option: option[:2], default=None)
    return best[2] if best is not None and best[0] else None


def _sizes(problem: Problem, terms: Sequence[Term]) -> dict[str, float]:
    """Return by effect how large it shows, whitened, when its parameters take their usual size one by one."""
    here = problem.residual((), np.empty(0))
    sizes: dict[str, float] = {}
    for term in terms:
        p = term.parameter
        sign = 1.0 if term.null + p.scale <= p.upper else -1.0
        moved = problem.residual([term], np.array([term.null + sign * p.scale])) - here
        sizes[term.id] = max(sizes.get(term.id, 0.0), float(np.linalg.norm(moved)))
    return sizes
