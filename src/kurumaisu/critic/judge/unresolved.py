# SPDX-License-Identifier: BSD-3-Clause
"""Something is surely wrong, and the data do not say what, or only when it was: amber, never green.

Drives held out tell it: what was found, though nobody can name it, predicts them better; or the model leaves them
farther off than the noise allows. So does what is beyond doubt in the drives to fit, though it predicts no others, and
of data too few to tell effects from noise, what any noise would make likelier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import expit

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.heldout import drive_gain
from kurumaisu.critic.heldout.materiality import CERTAIN, MATERIAL, NO_NOISE
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.unknown import sentences
from kurumaisu.critic.unknown.intermittent import Intermittent, intermittent
from kurumaisu.critic.values.criticism import UNRESOLVED, UNRESOLVED_P, Criticism
from kurumaisu.critic.values.digits import moment
from kurumaisu.critic.values.policy import UNKNOWN_ODDS
from kurumaisu.critic.values.story import Misfit, bins
from kurumaisu.critic.values.verdict import Gain, Unknown
from kurumaisu.types import FloatArray

_LEAST = 5.0  # [nat] of evidence for what cannot be named
_LOUDER = 1.5  # times the variance that the noise has, beyond which drives held out are not understood
_MISSED = 1.5  # times as far from where it came as noise alone would leave it, beyond which more must act
_SURE = 0.99  # of the blocks drawn again
_DRAWS = 500
_FORMS = 8  # sets of effects beside which it is asked whether something comes and goes


def with_unresolved(
    criticism: Criticism, made: Decision, gain: Gain | None, shares: dict[str, float], held_out: Sequence[Drive]
) -> Criticism:
    """Return a criticism that says so where it would say that nothing is wrong; shares: moved by each effect."""
    if criticism.verdict.verdict != "none":
        return criticism
    found = made.found
    nats = found.best.score - found.empty.score
    share = max(shares.values(), default=0.0)
    off = f"off by {100 * share:.2g} % of the way or turn"
    nearest = " with ".join(sorted(found.best.ids))
    shape, begun = f"{off} after 2 s; nearest {nearest}", f"Something is wrong: after 2 s the chair is {off}"
    if gain is not None and gain.log_density_per_sample.lo90 > 0 and nats >= _LEAST and share >= MATERIAL:
        words = (
            f"{begun}, and held-out data confirm it; but these data do not say what it is. Nearest is {nearest} "
            f"(--only {','.join(sorted(found.best.ids))})."
        )
        return _amber(criticism, shape, words)
    if not found.enough and _whatever_noise(found) >= _LEAST and share >= MATERIAL:
        few = f"{len(found.empty.beside.residual) // 3} intervals between poses are too few to say what it is"
        return _amber(criticism, shape, f"{begun}, however loud the noise; {few}. Nearest is {nearest}.")
    if gain is not None and found.nats(found.best) >= NO_NOISE and share >= MATERIAL:
        words = (
            f"{begun}. {nearest} fits the drives, but does not predict held-out ones: it is not the whole explanation."
        )
        return _amber(criticism, shape, words)
    louder = least_variance(made.problem, held_out)
    if louder > _LOUDER:
        times = float(np.sqrt(louder))
        words = (
            f"Something is wrong, and nobody can say what: held-out motion is off at least {times:.1f} times as far as "
            f"the noise that was estimated allows."
        )
        return _amber(criticism, f"held-out motion off {times:.1f} times as far as noise allows", words)
    return criticism


def with_remainder(criticism: Criticism) -> Criticism:
    """Return a criticism that says so where with all that was found held-out motion is far from what noise allows."""
    gain = criticism.verdict.gain
    said = criticism.verdict.verdict == "none" or any(one.covariate == UNRESOLVED for one in criticism.verdict.unknown)
    if said or gain is None or not gain.rmse:
        return criticism
    name, path = next(iter(gain.rmse.items()))  # over the shortest horizon
    if path.achievable is None or path.extended < _MISSED * path.achievable:
        return criticism
    words = (
        f"This is not the whole explanation: on held-out data the {name} is still off by {path.extended:.2g} m, where "
        f"noise alone would make it {path.achievable:.2g} m."
    )
    story = criticism.story
    return replace(criticism, story=replace(story, headline=f"{story.headline} {words}"))


def certain_intermittent(made: Decision, drives: Sequence[Drive]) -> tuple[Decision, Intermittent | None]:
    """Return what was found, and what surely comes and goes in drives beside it, and matters; None where nothing does.

    Where it does so beside the likeliest set, and not beside one that is nearly as likely, an equation of another form
    does without it, and leads.
    """
    problem, found, extension = made.problem, made.found, made.extension
    if not found.enough or (problem.ids is not None and effects.SMOOTH not in problem.ids):
        return made, None
    first: Intermittent | None = None
    for fit in found.near[: _FORMS if extension is None else 1]:
        one = intermittent(problem, drives, (fit if extension is None else extension).settings)
        if one is None or one.nats < CERTAIN or one.share * abs(one.size) < MATERIAL * _usual(problem, one.channel):
            return replace(made, found=found.led_by(fit)), None
        first = first or one
    return made, first


def with_intermittent(criticism: Criticism, one: Intermittent | None) -> Criticism:
    """Return a criticism that tells what comes and goes beside all that was found, with when that was."""
    if one is None:
        return criticism
    rate, share = sentences.CHANNEL_NAMES[one.channel], f"{100 * one.share:.0f} % of the time"
    unit = "" if effects.CHANNELS[one.channel].by else f" {effects.CHANNELS[one.channel].unit}"
    size = f"{abs(one.size):.2g}{unit}" if unit else f"{100 * abs(one.size):.0f} %"
    shape = f"comes and goes: {'more' if one.size > 0 else 'less'} by {size} for {share}"
    run, since, until = one.moments[0]
    words = (
        f"Outside the catalogue: now and then the {rate} is {'larger' if one.size > 0 else 'smaller'} by {size}, for "
        f"{share} (surest in {run} from {moment(since)} to {moment(until)}). The rest is judged without these moments."
    )
    p = float(expit(one.nats + np.log(UNKNOWN_ODDS)))
    unknown = Unknown(f"base.{effects.CHANNELS[one.channel].rate}", "time", shape, p)
    before = criticism.verdict
    others = tuple(other for other in before.unknown if other.covariate != UNRESOLVED)
    alone = before.verdict == "none"
    verdict = replace(before, verdict="unknown", unknown=(unknown, *others), gain=None if alone else before.gain)
    story = replace(
        criticism.story,
        headline=words if alone else f"{words} Besides: {criticism.story.headline}",
        misfits=(_figure(one, shape), *(() if alone else criticism.story.misfits)),
    )
    return replace(criticism, verdict=verdict, story=story)


def _figure(one: Intermittent, shape: str) -> Misfit:
    """Return by how much the channel was off in every moment, over the time."""
    first = np.array([one.samples.t[one.samples.run == run].min() for run in range(len(one.samples.runs))])
    since = one.samples.t - first[one.samples.run]
    return Misfit(
        channel=sentences.CHANNEL_NAMES[one.channel],
        unit=sentences.unit_of(one.channel),
        covariate_name="time since the start",
        covariate_unit="s",
        covariate=since,
        residual=one.offsets,
        bins=bins(since, one.offsets),
        explained_by=f"not in the catalogue: {shape}",
        moments=one.samples,
    )


def _usual(problem: Problem, channel: str) -> float:
    """Return the rms of what a channel's curve is added to."""
    into = effects.CHANNELS[channel]
    if into.by:
        return 1.0
    motions = [replay.motion(drive, problem.model, ()) for drive in problem.drives]
    return float(np.sqrt(np.mean(np.concatenate([getattr(one, into.rate) for one in motions]) ** 2)))


def _whatever_noise(found: SearchResult) -> float:
    """Return the evidence [nat] of the best set over nothing if nobody knew how loud the noise is.

    With the likeliest level of either: that which was estimated had few rows to go by.
    """
    best, empty = found.best, found.empty
    left, before = -2 * best.log_likelihood, -2 * empty.log_likelihood
    free = len(empty.beside.residual) - best.sizes
    if min(left, before, free) <= 0:
        return 0.0
    costs = (best.score - best.log_likelihood) - (empty.score - empty.log_likelihood)
    return 0.5 * free * float(np.log(before / left)) + costs


def least_variance(problem: Problem, drives: Sequence[Drive]) -> float:
    """Return how many times the noise's variance the model criticised leaves of drives, at least; 0 of none."""
    blocks: list[FloatArray] = []
    for drive in drives:
        left = (drive.measured - problem.simulated(drive, ())).reshape(-1, 1)
        white = problem.whitened(drive, left).reshape(-1, 3)
        blocks += [(block**2).ravel() for block in drive_gain.blocks(white, drive.times[1:] - drive.times[0])]
    if len(blocks) < 2:
        return 0.0
    sums = np.array([[block.sum(), len(block)] for block in blocks])
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(len(sums), np.full(len(sums), 1 / len(sums)), size=_DRAWS) @ sums
    return float(np.quantile(drawn[:, 0] / drawn[:, 1], 1 - _SURE))


def _amber(criticism: Criticism, shape: str, words: str) -> Criticism:
    unknown = Unknown("base", UNRESOLVED, shape, UNRESOLVED_P)
    verdict = replace(criticism.verdict, verdict="unknown", unknown=(unknown,))
    return replace(criticism, verdict=verdict, story=replace(criticism.story, headline=words))
