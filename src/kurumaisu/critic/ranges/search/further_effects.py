# SPDX-License-Identifier: BSD-3-Clause
"""What else acts on the mean, once what is loud is in place.

A search from nothing asks of a second effect a share of what the first one does, for the first one's equation may be
wrong by as much, and its line, too. With the first one refitted by simulation, and whatever other curve over what it
follows set aside, the rest needs no more than evidence: a latency is no curve over the range.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from kurumaisu.critic.ranges.search.confounding import Groups, confounded, merged
from kurumaisu.critic.ranges.search.effect_sets import LINE_ERROR, FittedForms, FormPosterior, FormSearch
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import ParameterFit
from kurumaisu.critic.ranges.signals.effect_columns import Form
from kurumaisu.critic.ranges.signals.form_error import FormFamily, integrated_out
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class FurtherEffects:
    """What acts beside a fit: found among the rest, forms as in the whole matrix; groups: sets that look alike."""

    found: FormPosterior
    groups: Groups

    def added_to(self, fit: FittedForms) -> FittedForms:
        """Return a fit with what acts beside it."""
        more = self.found.best
        return FittedForms(
            (*fit.forms, *more.forms),
            np.concatenate([fit.coefficients, more.coefficients]),
            np.concatenate([fit.sds, more.sds]),
            fit.log_likelihood + more.log_likelihood,
            fit.score + more.score,
        )


def further_effects(
    assembly: Assembly,
    normal: NormalEquations,
    found: FormPosterior,
    fit: FittedForms,
    refitted: ParameterFit,
    others: Mapping[str, FormFamily],
) -> FurtherEffects | None:
    """Return what acts beside a fit that was refitted; None where nothing does.

    normal: with noise that was estimated whatever else acts; found: of the search that the fit is from; others: curves
    that effects of the fit may follow instead.
    """
    known = {_key(form): form for form in assembly.forms if form.id not in fit.ids}
    if not known or not _promising(found, fit):
        return None
    # Seen anew: how far a chair turns within a delay is told by a path that the loud effect had bent.
    forms, columns = refitted.assembly.marks.forms(frozenset(form.id for form in known.values()))
    rest = [form for form in forms if _key(form) in known]
    # While a delay, say, is not in place, a path through the scans is too smooth beside jumps of the rates.
    beams = refitted.normal.beam_noise
    beams = replace(beams, valid=beams.valid & normal.beam_noise.valid)
    refitted = replace(refitted, normal=replace(normal, beam_noise=beams))
    curves = _curves(assembly, fit, others)
    gram = _gram([columns[:, :, form.span] for form in rest], refitted, curves)
    starts = np.cumsum([0, *(len(form.columns) for form in rest)])
    moved = [replace(form, start=int(start)) for form, start in zip(rest, starts[:-1], strict=True)]
    seen = FormSearch(moved, gram).run()
    if not seen.named and not seen.confounded:
        return None
    names = [*seen.named, *(name for group in seen.confounded for name in group if name in seen.best.ids)]
    groups = merged(seen.confounded, confounded(seen, None, (), gram, names))
    back = {form.start: known[_key(form)] for form in moved}
    fits = tuple(replace(one, forms=tuple(back[form.start] for form in one.forms)) for one in seen.fits)
    return FurtherEffects(replace(seen, fits=fits), groups)


def _key(form: Form) -> tuple[object, ...]:
    return (form.id, *form.at.items(), *(column.parameter.name for column in form.columns))


def _promising(found: FormPosterior, fit: FittedForms) -> bool:
    """Return whether one more effect would be likelier if no share of what is there were asked of it."""
    return any(_unasked(one) > _unasked(fit) for one in found.fits if one.ids > fit.ids)


def _unasked(fit: FittedForms) -> float:
    return fit.score + LINE_ERROR * max(len(fit.forms) - 1, 0) * fit.log_likelihood


def _curves(
    assembly: Assembly, fit: FittedForms, others: Mapping[str, FormFamily]
) -> list[tuple[FormFamily, FloatArray]]:
    """Return the curves that effects of a fit may follow instead, and what these effects do (k, b) [m]."""
    return [
        (others[form.id], assembly.columns[:, :, form.span] @ size) for form, size in fit.parts() if form.id in others
    ]


def _gram(
    parts: Sequence[NDArray[np.float32]], refitted: ParameterFit, curves: Sequence[tuple[FormFamily, FloatArray]]
) -> FloatArray:
    """Return the normal equations of columns (k, b, m) and, last, of what the refitted leave, whatever their sizes."""
    there = refitted.assembly
    left = there.residual - there.marks.together([setting for setting, _ in refitted.settings])
    count = sum(part.shape[2] for part in parts)
    free = [curve.columns(there.shots, there.marks.seen) for curve, _ in curves]
    signals = [change[:, :, np.newaxis] for _, change in curves]
    every = np.concatenate([*parts, refitted.slopes, *free, *signals], axis=2)
    gram = there.products(refitted.normal, every, left)
    ends = np.cumsum([count, refitted.slopes.shape[2], *(part.shape[2] for part in free)])
    powers = np.diag(gram)[ends[-1] : -1]
    priors = [
        curve.scaled(gram[low:high, low:high], power)
        for (curve, _), low, high, power in zip(curves, ends[1:-1], ends[2:], powers.tolist(), strict=True)
    ]
    drawn = np.arange(count, ends[-1])
    keep = np.r_[np.arange(count), len(gram) - 1]
    prior = block_diag(np.eye(refitted.slopes.shape[2]), *priors)
    return integrated_out(gram, drawn, prior)[np.ix_(keep, keep)]
