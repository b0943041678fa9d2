# SPDX-License-Identifier: BSD-3-Clause
"""Pictures: runs from above; residuals over what an effect follows, and what is left when it is in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import GRID, Drive, prepare
from kurumaisu.critic.base.replay import PICTURE, RESTART, restarted_path
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.story import FOLLOWED, Misfit, Moments, Overlay, bins, explained
from kurumaisu.effects import Follows, Rate
from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.params import EffectSetting, Model
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
            left = white[:, channel]
            r = float(np.corrcoef(left, x)[0, 1]) if left.std() and x.std() else 0.0
            if abs(r) * np.sqrt(len(x)) > _NOTEWORTHY:
                said.append(f"The residual {rate.value} still follows the {follows.value} (correlation {r:+.2f}).")
    return tuple(said) or ("The residual follows neither the commanded rates nor their changes.",)


def _figure(problem: Problem, settings: Sequence[EffectSetting], effect: type[effects.BaseEffect]) -> Misfit:
    others = tuple(setting for setting in settings if setting.id != effect.id)
    samples = []  # residual without the effect and what it adds, as rates (m, 3)
    for drive in problem.drives:
        dt, without = np.diff(drive.times)[:, np.newaxis], problem.simulated(drive, others)
        samples.append(((drive.measured - without) / dt, (problem.simulated(drive, settings) - without) / dt))
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


def overlays(
    recording: Recording, model: Model, settings: Sequence[EffectSetting] | None = None
) -> tuple[Overlay, ...]:
    """Return a picture of every run that is whole enough for one; settings: what extends the model, if anything."""
    drawn = []
    for run in recording.runs:
        with suppress(Error):
            drawn.append(_overlay(run, model, settings, held_out=run.name in recording.test))
    return tuple(drawn)


def _overlay(run: Run, model: Model, settings: Sequence[EffectSetting] | None, *, held_out: bool) -> Overlay:
    drive = with_covariates(prepare(run, model, PICTURE), run)
    baseline, off = _restarted(drive, replay.path(drive, model, ()))
    extended, off_extended = None, None
    if settings is not None:
        extended, off_extended = _restarted(drive, replay.path(drive, model, settings))
    path = drive.poses[:, :2]
    return Overlay(drive.name, path, baseline, extended, held_out, RESTART, off, off_extended, drive.times)


def _restarted(drive: Drive, path: FloatArray) -> tuple[FloatArray, float | None]:
    """Return a simulated path (n, 2) in pieces that begin at measured poses, nan between, and how far off they end."""
    pieces, off = [], []
    for rows, poses in restarted_path(drive, path):
        pieces += [poses[:, :2], np.full((1, 2), np.nan)]
        if drive.times[rows][-1] - drive.times[rows][0] > RESTART / 2:
            off.append(np.sum((poses[-1] - drive.poses[rows][-1])[:2] ** 2))
    return np.concatenate(pieces)[:-1], float(np.sqrt(np.mean(off))) if off else None
