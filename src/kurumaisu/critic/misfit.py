# SPDX-License-Identifier: BSD-3-Clause
"""Residuals drawn over what an effect follows, and what is left when it is in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.drive import GRID, Drive
from kurumaisu.critic.evidence import Fit, Problem
from kurumaisu.critic.story import Bins, Misfit
from kurumaisu.critic.verdict import NORMAL90
from kurumaisu.effects import Follows, Rate
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_BINS = 15  # at most
_FEWEST = 5  # points of which a mean has an interval
_CHANGE = 0.5  # [s] over which a change of the input is taken
_NOTEWORTHY = 4.0  # standard errors from which a remaining correlation is said

_UNITS = {Rate.V: "m/s", Rate.W: "rad/s", Follows.V: "m/s", Follows.W: "rad/s"}
_UNITS |= {Follows.V_CHANGE: f"m/s in {_CHANGE:g} s", Follows.W_CHANGE: f"rad/s in {_CHANGE:g} s"}


def figures(problem: Problem, settings: Sequence[EffectSetting], ids: Iterable[str]) -> tuple[Misfit, ...]:
    """Return, per effect, the residual without it over the quantity that it follows, and what it adds there.

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
                said.append(f"The {rate.value} still follows the {follows.value} a little (correlation {r:+.2f}).")
    return tuple(said) or ("The residual follows neither the rates asked for nor their changes.",)


def _figure(problem: Problem, settings: Sequence[EffectSetting], effect: type[effects.BaseEffect]) -> Misfit:
    others = tuple(setting for setting in settings if setting.id != effect.id)
    channel = 0 if effect.shows_in is Rate.V else 2
    x, residual, added = (
        np.concatenate(parts)
        for parts in zip(
            *(_samples(problem, drive, settings, others, effect.follows, channel) for drive in problem.drives),
            strict=True,
        )
    )
    shown = bins(x, residual)
    curve = bins(x, added, 1)
    return Misfit(
        channel=effect.shows_in.value,
        unit=_UNITS[effect.shows_in],
        covariate_name=effect.follows.value,
        covariate_unit=_UNITS[effect.follows],
        covariate=x,
        residual=residual,
        bins=shown,
        explained_by=effect.id,
        curve=np.column_stack([curve.centre, curve.mean]),
    )


def _samples(
    problem: Problem,
    drive: Drive,
    settings: Sequence[EffectSetting],
    others: Sequence[EffectSetting],
    follows: Follows,
    channel: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    dt = np.diff(drive.times)
    without = problem.simulated(drive, others)[:, channel]
    residual = (drive.measured[:, channel] - without) / dt
    added = (problem.simulated(drive, settings)[:, channel] - without) / dt
    return covariate(drive, follows), residual, added


def bins(x: FloatArray, y: FloatArray, fewest: int = _FEWEST) -> Bins:
    """Return means of y in bins of x of equal width; bins with fewer points are left out."""
    count = int(np.clip(len(x) // (2 * _FEWEST), 3, _BINS))
    low, high = np.quantile(x, [0.005, 0.995])
    index = np.clip(np.floor((x - low) / max(high - low, 1e-12) * count), 0, count - 1)
    rows = []
    for i in np.unique(index):
        inside = index == i
        if inside.sum() >= fewest:
            error = NORMAL90 * y[inside].std() / np.sqrt(inside.sum())
            rows.append((x[inside].mean(), y[inside].mean(), y[inside].mean() - error, y[inside].mean() + error))
    centre, mean, lo, hi = np.array(rows).reshape(-1, 4).T
    return Bins(centre, mean, lo, hi)


def _correlation(a: FloatArray, b: FloatArray) -> float:
    if a.std() == 0 or b.std() == 0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
