# SPDX-License-Identifier: BSD-3-Clause
"""What the search found, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.heldout.materiality import HORIZON, MATERIAL
from kurumaisu.critic.judge.turning_only import EXPLAINED
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.values.digits import quantities, with_interval
from kurumaisu.critic.values.policy import NAMED, RIVAL
from kurumaisu.critic.values.story import Alternative
from kurumaisu.critic.values.verdict import Cause, Estimate, Verdict, grouped

_MINUTE = 60.0  # [s]
OTHER_FORM = 5.0  # [nat] by which what an equation misses must be likelier than that it misses nothing
_CAUSES_TOLD = 4  # in a headline
_KINDS_TOLD = 2  # of problems in a headline
_RIVALS_SHOWN = 4  # of those with other causes, and of those with more or fewer

_NO_MORE = "no more than the scale of the imu may be off by"
UNTESTED = "The held-out drives hardly show this effect, so they neither confirm nor refute it."


def headline(verdict: Verdict, found: SearchResult, matters: set[str], shares: dict[str, float]) -> str:
    """Return the verdict in one sentence.

    matters: effects of the best set that move the chair enough, as data held out confirm; shares: how far each does.
    """
    if verdict.verdict == "named":
        return named_causes(verdict.causes)
    if verdict.verdict == "confounded":
        group = " or ".join(verdict.confounded[0])
        return f"The model lacks an effect, but these drives cannot tell which: {group}."
    if not found.enough:
        return "No effect can be named: too little was recorded to tell effects from noise."
    listed = ", ".join(sorted(found.best.ids))
    if found.best.ids and verdict.gain is None:
        return f"No effect can be named: {listed} is suspected, but too little was recorded to test it."
    if found.best.ids and not matters and max(shares.values()) >= MATERIAL:
        return f"No effect can be named: {listed} fits these drives, but held-out data do not confirm it."
    if found.best.ids and not matters:
        return f"No effect matters: {listed} is detectable, but too small to improve the simulation."
    # Nothing is near where nothing of the base was looked for.
    nearest = max(found.p, key=lambda name: found.p[name], default=None)
    if nearest is not None and found.p[nearest] >= RIVAL:
        return f"No effect can be named: noise explains these drives as well. The nearest suspect is {nearest}."
    return "These drives show no effect that the model lacks."


def wrong_data(problems: Sequence[str]) -> str:
    """Return in a sentence that the data are wrong, and what is wrong first of all."""
    kinds = [kind for kind, _ in grouped(problems)]
    more = f"; and {len(kinds) - _KINDS_TOLD} more" if len(kinds) > _KINDS_TOLD else ""
    return f"The data are wrong, so nothing was fitted: {'; '.join(kinds[:_KINDS_TOLD])}{more}."


def named_causes(causes: Sequence[Cause]) -> str:
    """Return in a sentence what acts, with ids and sizes."""
    text = "; ".join(f"{effects.by_id(cause.id).sentence} ({_sizes(cause)})" for cause in causes[:_CAUSES_TOLD])
    rest = f"; and {', '.join(cause.id for cause in causes[_CAUSES_TOLD:])}" if len(causes) > _CAUSES_TOLD else ""
    return f"{text[0].upper()}{text[1:]}{rest}."


def _sizes(cause: Cause) -> str:
    said = [f"{name} {quantities([e.estimate], e.unit)[0]}" for name, e in cause.parameters.items() if e.estimate != 0]
    return f"{cause.id}: {', '.join(said)}" if said else cause.id


def details(
    problem: Problem,
    found: SearchResult,
    drives: Sequence[Drive],
    sizes: Mapping[str, Mapping[str, Estimate]],
    shares: dict[str, float],
    matters: set[str],
) -> tuple[str, ...]:
    """Return what a reader should know next; sizes, shares: of each effect, and by which it moves the chair."""
    seconds = sum(float(drive.times[-1] - drive.times[0]) for drive in drives)
    said = [
        f"{len(drives)} drive{'s' * (len(drives) > 1)}, {seconds:.0f} s, replayed from the {drives[0].source} channel.",
    ]
    fitted: dict[str, list[str]] = {}
    forms = {term.key: term.parameter for term in found.best.terms if term.fixed}
    for name, own in sizes.items():
        for parameter, e in own.items():
            form = forms.get((name, parameter))
            if form is None:
                fitted.setdefault(name, []).append(f"{parameter} {with_interval(e.estimate, e.lo90, e.hi90, e.unit)}")
            elif e.estimate != form.null:  # of the usual form nothing need be said
                fitted.setdefault(name, []).append(f"{parameter} {quantities([e.estimate], e.unit)[0]}")
    for name, told in fitted.items():
        moved = (
            f"after {HORIZON:g} s the chair is off by {100 * shares[name]:.1f} % of the distance driven or angle turned"
        )
        weighed = f"{moved}{_weight(name, found, shares, matters)}{_form(name, found)}"
        said.append(f"{name}: {', '.join(told)}; {_NO_MORE if shares[name] == EXPLAINED else weighed}.")
    n = problem.noise
    wander = np.degrees(np.sqrt(2 * _MINUTE * (n.sd_w**2 * n.tau + n.slow_w**2 * n.slow_tau)))
    said.append(f"Noise of the yaw rate turns the heading by about {wander:.0f}° in a minute; no model can predict it.")
    return tuple(said)


def _form(name: str, found: SearchResult) -> str:
    """Return that a cause is of another form than its equation, if that is likely."""
    drawn = any(
        name in one.form_of for one in found.curves[:1] if found.log_posterior(one) > found.log_posterior(found.best)
    )
    if not drawn and found.best.beside.forms.get(name, 0.0) < OTHER_FORM:
        return ""
    return f"; of another form than {effects.by_id(name).formula}: the sizes are those of the nearest of that form"


def _weight(name: str, found: SearchResult, shares: dict[str, float], matters: set[str]) -> str:
    if name not in matters:
        small = shares[name] < MATERIAL
        why = "not confirmed on held-out data" if found.enough else "too little was recorded to name it"
        return ": detectable, but too small to matter" if small else f": {why}"
    if any(name in group for group in found.confounded):
        return ": a similar effect may act instead"
    return "" if found.p[name] >= NAMED else ": not certain enough to be named"


def suspects(found: SearchResult) -> tuple[str, ...]:
    """Return a sentence on the effects that may act, for all that these drives show."""
    some = sorted((name for name in found.p if RIVAL <= found.p[name] < NAMED), key=lambda n: -found.p[n])
    if not some:
        return ()
    listed = ", ".join(f"{name} (p = {found.p[name]:.2f})" for name in some)
    return (f"Suspected, but not certain enough to be named: {listed}.",)


def rivals(found: SearchResult) -> tuple[Alternative, ...]:
    """Return sets with other causes and sets with more or fewer, the best of each kind, by their evidence."""
    best = found.best
    # Of the ways in which the same effects may act, the best one stands for all.
    unlike = {fit.ids: fit for fit in reversed(found.fits) if fit.ids != best.ids}
    ranked = sorted(unlike.values(), key=lambda fit: -fit.score)
    swapped = [fit for fit in ranked if not (fit.ids >= best.ids or fit.ids < best.ids)]
    others = [fit for fit in ranked if fit.ids > best.ids or fit.ids < best.ids]
    shown = sorted(swapped[:_RIVALS_SHOWN] + others[:_RIVALS_SHOWN], key=lambda fit: -fit.score)
    return tuple(_rival(fit, best) for fit in shown)


def _rival(fit: Fit, best: Fit) -> Alternative:
    likelihood = fit.log_likelihood - best.log_likelihood
    if fit.score > best.score:
        why = f"fits better by {likelihood:.1f} nats, too little for one more effect, which is improbable a priori"
    elif fit.ids > best.ids:
        why = f"fits better by {likelihood:.1f} nats, too little to justify another effect"
    elif fit.ids < best.ids or likelihood < 0:
        why = f"fits worse by {-likelihood:.1f} nats"
    else:
        why = f"fits better by {likelihood:.1f} nats, but needs more effects"
    return Alternative(" + ".join(sorted(fit.ids)) or "no effect", fit.score - best.score, why)
