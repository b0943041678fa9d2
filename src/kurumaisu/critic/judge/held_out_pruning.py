# SPDX-License-Identifier: BSD-3-Clause
"""What data held out refuse is left out, so that it spoils nothing certain: effects nobody is sure of, and curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Fit
from kurumaisu.critic.heldout.materiality import CERTAIN, NO_NOISE, confirmed, expected_nats, holds
from kurumaisu.critic.judge import explain_unknown
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.values.verdict import Gain

_TRIED = 2  # smaller sets, the likeliest first: each is fitted to all folds
_MET = 3.0  # [nat] that drives held out must be able to tell for their silence to say anything


def confirmed_part(
    made: Decision, gain: Gain | None, measure: Callable[[Decision], Gain]
) -> tuple[Decision, Gain | None]:
    """Return a decision with what it is worth, or that of what is confirmed in its place.

    That is a smaller set which keeps what is named, or one of all without one effect, where all together are beyond
    doubt: one that is wrong must not hide the others. For a curve of which nobody would be told, the catalogue's own.
    """
    found = made.found
    if gain is None:
        return made, gain
    if made.extension is not None:
        told = explain_unknown.is_reported(made, gain)
        if told and not made.extension.fit.ids:
            return made, gain
        return _without_curves(made, gain, measure, gain.log_density_per_sample.gain if told else -np.inf)
    if holds(gain, found.nats(found.best)):
        return made, gain
    smaller = [fit for fit in found.fits if fit.ids and set(found.named) <= fit.ids < found.best.ids]
    for fit in smaller[:_TRIED]:
        other = _with_best(made, fit)
        gained = measure(other)
        if confirmed(gained, found.nats(fit)):
            return other, gained
    return _without_one(made, gain, measure)


def leave_one_out(made: Decision, held: Gain | None, measure: Callable[[], Gain]) -> Gain | None:
    """Return what effects are worth with each drive to fit left out in turn, too, if that confirms them.

    Only where drives held out decide nothing: nobody may have driven so as to meet what acts, such as a threshold.
    """
    if held is None or not _unconfirmed(made, held) or held.log_density_per_sample.hi90 < 0:
        return held
    again = measure()
    return again if confirmed(again, made.found.nats(made.found.best)) else held


def untested(made: Decision, held: Gain | None, drives: Sequence[Drive]) -> bool:
    """Tell whether drives held out can neither confirm nor refute effects that are certain: they hardly meet them.

    held: what the effects gain on these drives. What would be surprised there by more than chance is refuted.
    """
    if held is None or not _unconfirmed(made, held) or held.log_density_per_sample.hi90 <= 0:
        return False
    return expected_nats(made.problem, drives, made.found.best.settings, ()) < _MET


def _without_one(made: Decision, gain: Gain, measure: Callable[[Decision], Gain]) -> tuple[Decision, Gain]:
    """Return a decision without the one of its effects that leaves most, where that is confirmed beyond doubt."""
    found, best = made.found, made.found.best
    fewer = [fit for fit in found.fits if fit.ids and len(best.candidates - fit.candidates) == 1]
    fewer = [fit for fit in fewer if fit.candidates < best.candidates and found.nats(fit) >= NO_NOISE]
    tried = [(fit, measure(_with_best(made, fit))) for fit in fewer]
    fit, gained = max(tried, key=lambda one: one[1].log_density_per_sample.gain, default=(best, gain))
    return (_with_best(made, fit), gained) if confirmed(gained, found.nats(fit)) else (made, gain)


def _unconfirmed(made: Decision, held: Gain) -> bool:
    """Tell whether effects are certain by the drives they were fitted to, and not confirmed by those held out."""
    nats = made.found.nats(made.found.best)
    return made.extension is None and nats >= CERTAIN and not confirmed(held, nats)


def _without_curves(
    made: Decision, gain: Gain, measure: Callable[[Decision], Gain], least: float
) -> tuple[Decision, Gain]:
    """Return what acts if no curve does, where that is confirmed: a curve that is not must not hide it.

    least: per sample, what it must be worth besides [nat]: a curve shares in what the effects beside it are worth.
    """
    other = replace(made, extension=None)
    if not other.something:
        return made, gain
    gained = measure(other)
    held = confirmed(gained, other.found.nats(other.found.best)) and gained.log_density_per_sample.gain >= least
    return (other, gained) if held else (made, gain)


def _with_best(made: Decision, fit: Fit) -> Decision:
    """Return the decision with another set as the best, and the sets of rivals that its effects are in."""
    found = made.found
    fits = (fit, *(other for other in found.fits if other is not fit))
    groups = tuple(group for group in found.confounded if fit.ids & set(group))
    return replace(made, found=replace(found, fits=fits, confounded=groups))
