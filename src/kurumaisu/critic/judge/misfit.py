# SPDX-License-Identifier: BSD-3-Clause
"""Residuals drawn over what an effect follows, and what is left when it is in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.values.binned_means import FOLLOWED, bins, explained
from kurumaisu.critic.values.story import Misfit, Moments
from kurumaisu.effects import Follows, Rate
from kurumaisu.geometry import wrap
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_CHANGE = 0.5  # [s] over which a change of the input is taken
_CLEARLY = 0.15  # of that share, by which another covariate must be better than the usual one
_NOTEWORTHY = 4.0  # standard errors from which a remaining correlation is said

# Increments as rates, in the order of their columns, with their units.
RATE_CHANNELS = {"v": ("forward speed", "m/s"), "lateral": ("sideways speed", "m/s"), "w": ("yaw rate", "rad/s")}
_UNITS = {Follows.V: "m/s", Follows.W: "rad/s"}
_UNITS |= {Follows.V_CHANGE: f"m/s in {_CHANGE:g} s", Follows.W_CHANGE: f"rad/s in {_CHANGE:g} s"}


@dataclass(frozen=True)
class Covariate:
    """What a misfit may be drawn over: as a reader calls it, its unit, and a value per sample, (n,)."""

    name: str
    unit: str
    values: FloatArray


def figures(problem: Problem, settings: Sequence[EffectSetting], ids: Iterable[str]) -> tuple[Misfit, ...]:
    """Return, per effect, what is wrong without it where it acts most, over what it follows best, and what it adds.

    The other effects of the fit are in, so each figure shows one cause alone.
    """
    by_id = {effect.id: effect for effect in effects.BASE}
    return tuple(_figure(problem, settings, by_id[name]) for name in ids)


def covariate(drive: Drive, follows: Follows) -> FloatArray:
    """Return a quantity per increment of the reference, (m,)."""
    rate = drive.v if follows in (Follows.V, Follows.V_CHANGE) else drive.w
    integral = np.concatenate([[0.0], np.cumsum(rate) * GRID])
    edges = drive.start + GRID * np.arange(len(integral))

    def mean(since: FloatArray, until: FloatArray) -> FloatArray:
        gained = np.interp(until, edges, integral) - np.interp(since, edges, integral)
        return np.asarray(gained / (until - since))

    since, until = drive.times[:-1], drive.times[1:]
    if follows in (Follows.V, Follows.W):
        return mean(since, until)
    return mean(since, until) - mean(since - _CHANGE, until - _CHANGE)


def remaining(problem: Problem, fit: Fit) -> tuple[str, ...]:
    """Return what the residual still follows with the fit in, in sentences, and one that says so when it is nothing."""
    white = problem.residual(fit.terms, fit.values).reshape(-1, 3)
    said = []
    for channel, rate in ((0, Rate.V), (2, Rate.W)):
        for follows in Follows:
            x = np.concatenate([covariate(drive, follows) for drive in problem.drives])
            r = _correlation(white[:, channel], x)
            if abs(r) * np.sqrt(len(x)) > _NOTEWORTHY:
                said.append(f"The residual {rate.value} still follows the {follows.value} (correlation {r:+.2f}).")
    return tuple(said) or ("The residual follows neither the commanded rates nor their changes.",)


def _figure(problem: Problem, settings: Sequence[EffectSetting], effect: type[effects.BaseEffect]) -> Misfit:
    others = tuple(setting for setting in settings if setting.id != effect.id)
    samples = [_samples(problem, drive, settings, others) for drive in problem.drives]
    residual, added = (np.concatenate(parts) for parts in zip(*samples, strict=True))
    # The channel in which the effect stands out most from what is left when it is in.
    left = residual - added
    channel = int(np.argmax(np.mean(added**2, axis=0) / np.maximum(left.var(axis=0), 1e-12)))
    name, unit = list(RATE_CHANNELS.values())[channel]
    over = _followed(_covariates(problem.drives), effect.follows.value, added[:, channel])
    x = over.values if over is not None else added[:, channel]
    curve = bins(x, added[:, channel], 1)
    return Misfit(
        channel=name,
        unit=unit,
        covariate_name=over.name if over is not None else f"change by {effect.id}",
        covariate_unit=over.unit if over is not None else unit,
        covariate=x,
        residual=residual[:, channel],
        bins=bins(x, residual[:, channel]),
        explained_by=effect.id,
        curve=np.column_stack([curve.centre, curve.mean]),
        after=bins(x, left[:, channel]),
        moments=moments(problem.drives),
    )


def moments(drives: Sequence[Drive]) -> Moments:
    """Return when and where each increment of drives began."""
    runs = tuple(dict.fromkeys(drive.name for drive in drives))
    return Moments(
        runs=runs,
        run=np.concatenate([np.full(len(drive.times) - 1, runs.index(drive.name)) for drive in drives]),
        t=np.concatenate([drive.times[:-1] for drive in drives]),
        places=np.concatenate([drive.poses[:-1, :2] for drive in drives]),
    )


def _samples(
    problem: Problem, drive: Drive, settings: Sequence[EffectSetting], others: Sequence[EffectSetting]
) -> tuple[FloatArray, FloatArray]:
    """Return residual without an effect and what it adds, as rates (m, 3)."""
    dt = np.diff(drive.times)[:, np.newaxis]
    without = problem.simulated(drive, others)
    return (drive.measured - without) / dt, (problem.simulated(drive, settings) - without) / dt


def _covariates(drives: Sequence[Drive]) -> list[Covariate]:
    """Return what an effect may be drawn over, per increment of all drives."""
    parts = {f.value: [covariate(drive, f) for drive in drives] for f in Follows}
    out = [Covariate(f.value, _UNITS[f], np.concatenate(parts[f.value])) for f in Follows]
    v, w = out[0].values, out[1].values
    out.append(Covariate("product of the commanded rates", "m/s²", v * w))
    out.append(Covariate("absolute commanded forward speed", "m/s", np.abs(v)))
    out.append(Covariate("absolute commanded yaw rate", "rad/s", np.abs(w)))
    out.append(Covariate("heading", "rad", np.concatenate([wrap(drive.poses[:-1, 2]) for drive in drives])))
    since = [drive.times[:-1] - drive.times[0] for drive in drives]
    return [*out, Covariate("time since the start", "s", np.concatenate(since))]


def _followed(covariates: Sequence[Covariate], usual: str, added: FloatArray) -> Covariate | None:
    """Return what the added part follows: the usual covariate where none is clearly better, None where it has none."""
    share = {each.name: explained(each.values, added) for each in covariates}
    best = max(covariates, key=lambda each: share[each.name] + (_CLEARLY if each.name == usual else 0.0))
    return best if share[best.name] >= FOLLOWED else None


def _correlation(a: FloatArray, b: FloatArray) -> float:
    if a.std() == 0 or b.std() == 0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
