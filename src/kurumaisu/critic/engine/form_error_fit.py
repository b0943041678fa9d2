# SPDX-License-Identifier: BSD-3-Clause
"""What causes may do in other forms than the catalogue's: no real lag has one pole, no real limit a sharp corner.

What an equation misses lies along other effects, so a strong cause of another form would bring false ones with it. So
where that is likelier than an exact equation, what it may miss is noise: a Gaussian process whose directions are the
marks of the same cause at other sizes (a sum of lags is a lag of more poles, a sum of dead zones a soft one). What
makes a chair slow to respond may do so more when it speeds up than when it slows down, or less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.catalogue import settings_of
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.engine.form_error import FormError, change, outside_span
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

# Sizes of a cause, as shares of the one fitted, whose marks together stand for those of its other forms.
_SIZES = (0.25, 0.5, 1.5, 2.0, 3.0)
_FORM_ERRORS = (0.05, 0.15)  # what an equation may miss, as a share of its signal's norm, 1 sd
_STRONG = 15.0  # norm of a signal from which that could show
_LEAST = 3.0  # [nat] by which it must be likelier than nothing, and than one more effect
_WEIGHED = 6  # sets, the best ones, besides parts of the best one
_NEAR = 1.05  # times a size, which says what a fit does itself
_OWN_SHARE = 0.05  # share of a mark that a fit must not be able to do itself, else it is no other form


def columns(problem: Problem, drive: Drive, fit: Fit) -> FloatArray:
    """Return what the increments of a drive would be more if each cause were of other sizes, (3 m, k).

    A mark that is no multiple of the fitted one's is that of another form: a rounder corner, a longer tail.
    """
    return np.column_stack([np.empty((drive.measured.size, 0)), *_changes(problem, drive, fit, _other_sizes(fit))])


def likeliest_form_error(problem: Problem, found: SearchResult) -> tuple[FormError | None, Fit]:
    """Return what the causes of the likeliest set miss, where that is likelier than that they miss nothing; and it.

    The likeliest with what it misses, that is: without, others are in it that draw the same.
    """
    known = {fit.candidates: fit for fit in reversed(found.fits)}

    def weighed(fit: Fit) -> tuple[float, Fit, FormError | None]:
        gain, what = _form_error_of(problem, fit)
        return log_posterior(fit, len(found.p)) + gain, fit, what

    first = best = max((weighed(fit) for fit in found.fits[:_WEIGHED]), key=lambda one: one[0])
    while len(best[1].candidates) > 1:
        parts = [best[1].candidates - {one} for one in sorted(best[1].candidates, key=lambda one: one.id)]
        fits = [known.get(part) or problem.fit_candidates(part, best[1].start) for part in parts]
        fewer = max((weighed(fit) for fit in fits), key=lambda one: one[0])
        if fewer[0] <= best[0]:
            break
        best = fewer
    _, fit, what = best if best[0] > first[0] + _LEAST else first
    return what, fit


def _form_error_of(problem: Problem, fit: Fit) -> tuple[float, FormError | None]:
    """Return how much likelier the data are with what the equations of a set miss, in nats, and that; else 0, None."""
    loud = _signal_norms(problem, fit)
    marks = [mark for mark in _other_sizes(fit) if loud.get(mark.id, 0.0) >= _STRONG]
    if not marks:
        return 0.0, None
    near = [mark for mark in _other_sizes(fit, (_NEAR,)) if not mark.held_back]
    whole, parts = np.zeros(len(marks)), []
    for drive in problem.drives:
        left = (drive.measured - problem.simulated(drive, fit.settings)).ravel()
        white = problem.whitened(drive, np.column_stack([left, *_changes(problem, drive, fit, [*near, *marks])]))
        whole += np.sum(white[:, 1 + len(near) :] ** 2, axis=0)
        parts.append((white[:, 0], outside_span(white[:, 1 : 1 + len(near)], white[:, 1 + len(near) :])))
    lengths = np.sqrt(np.sum([np.sum(mark**2, axis=0) for _, mark in parts], axis=0))
    bent = lengths > _OWN_SHARE * np.sqrt(whole)
    names = np.array([mark.id for mark in marks])
    many = np.array([np.sum(bent & (names == name)) for name in names])
    signals = np.array([loud[name] for name in names])
    shares = np.where(bent, signals / np.sqrt(np.maximum(many, 1)) / np.where(bent, lengths, 1.0), 0.0)
    sds = [np.minimum(share * shares, 1.0) for share in _FORM_ERRORS]
    gains = [sum(_gain(left, sd * mark) for left, mark in parts) for sd in sds]
    best = int(np.argmax(gains))
    if gains[best] < _LEAST:
        return 0.0, None
    each = zip(marks, sds[best].tolist(), strict=True)
    moved = tuple((mark.settings, mark.held_back, sd) for mark, sd in each if sd > 0)
    return gains[best], FormError(fit.settings, moved, tuple(mark.settings for mark in near))


def _gain(left: FloatArray, marks: FloatArray) -> float:
    """Return how much likelier white noise (rows,) is with marks (rows, k) by normal shares, sd 1, in nats."""
    values, vectors = np.linalg.eigh(marks.T @ marks)
    values, along = np.maximum(values, 0.0), vectors.T @ (marks.T @ left)
    return 0.5 * float(np.sum(along**2 / (1 + values)) - np.sum(np.log1p(values)))


@dataclass(frozen=True)
class _OtherSize:
    """What a cause would do with another size: its id, all settings, and whether only where it holds the chair back."""

    id: str
    settings: tuple[EffectSetting, ...]
    held_back: bool


def _other_sizes(fit: Fit, shares: Sequence[float] = _SIZES) -> list[_OtherSize]:
    """Return the marks of each term of a fit that has a size, where that is other ones."""
    out = []
    for i, term in enumerate(fit.terms):
        responds = getattr(effects.by_id(term.id), "stage", None) == effects.Stage.RESPONSE
        for share in () if term.fixed else shares:
            value = term.null + share * (fit.values[i] - term.null)
            value = float(np.clip(value, term.parameter.lower, term.parameter.upper))
            moved = settings_of(fit.terms, np.where(np.arange(len(fit.values)) == i, value, fit.values))
            out += [_OtherSize(term.id, moved, held_back) for held_back in ((False, True) if responds else (False,))]
    return out


def _changes(problem: Problem, drive: Drive, fit: Fit, marks: Sequence[_OtherSize]) -> list[FloatArray]:
    """Return what each mark changes of the increments of a drive, (3 m,) each."""
    here = problem.simulated(drive, fit.settings)
    return [change(here, problem.simulated(drive, mark.settings), held_back=mark.held_back) for mark in marks]


def _signal_norms(problem: Problem, fit: Fit) -> dict[str, float]:
    """Return the norm of each cause's signal beside the others, of those whose forms are smooth."""
    here = problem.residual(fit.terms, fit.values)
    out = {}
    for candidate in fit.candidates:
        if candidate.rough:
            continue
        own = np.array([term.id == candidate.id and not term.shape and not term.fixed for term in fit.terms])
        null = np.where(own, [term.null for term in fit.terms], fit.values)
        out[candidate.id] = float(np.linalg.norm(problem.residual(fit.terms, null) - here))
    return out
