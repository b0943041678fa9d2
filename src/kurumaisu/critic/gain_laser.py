# SPDX-License-Identifier: BSD-3-Clause
"""What effects on the laser are worth on scans that they were not fitted to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.gain import log_density_gain, rmse_gain
from kurumaisu.critic.laser.shots import Shots, missing
from kurumaisu.critic.predict_motion import Forecast
from kurumaisu.critic.predict_scan import Expected, Joint, ScanModel, expected, scattered
from kurumaisu.critic.predict_track import Places, chosen, joined, rows_of
from kurumaisu.critic.recording import Recording
from kurumaisu.critic.verdict import ChannelGain
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import BoolArray, FloatArray

CHANNEL = "range"
_SCANS = 60  # of test runs
_PARTS = 4  # of a single run, of which each is held out in turn
_BLOCK = 5  # scans resampled as a whole: neighbours share the errors of their poses
_OUTLIER = 5.0  # deviations
_STEP = 0.05  # of a parameter, as a share of its distance from the null, to see what it does
_VAGUE = 1.0  # sd of a parameter before it is fitted again, as a share of the same
Settings = tuple[EffectSetting, ...]


@dataclass(frozen=True)
class Split:
    """Scans to fit and scans to judge by; apart: those to judge by were not among those that found what extends."""

    train: Shots
    test: Shots
    apart: bool


def measure(recording: Recording, model: Model, forecast: Forecast | None, settings: Settings) -> ChannelGain | None:
    """Return the gain per reading of what extends a model's laser; None where there is nothing to measure it on.

    forecast: of the base, None where nothing drove it; settings: the laser's and the map's.
    """
    if not settings or missing(recording) is not None:
        return None
    sums: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    squares: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    for split in _splits(recording, model, forecast):
        refitted = settings if split.apart else refit(split.train, settings)
        sides = [_side(split, some, recording.truth) for some in ((), refitted)]
        use = sides[0].counts & sides[1].counts
        for i, side in enumerate(sides):
            joint = Joint(side.what, side.error, use)
            density = joint.log_density(side.trained.factors)
            for rows in np.array_split(np.arange(len(use)), max(len(use) // _BLOCK, 1)):
                if use[rows].any():
                    share = density[rows].sum() / joint.count[rows].sum()
                    sums[i].append(np.full(int(joint.count[rows].sum()), share))
                    squares[i].append(side.error[rows][use[rows]] ** 2)
    if not sums[0]:
        return None
    return ChannelGain(log_density_gain(*sums), rmse_gain(*squares, "m"))


@dataclass(frozen=True)
class _Side:
    """Of one model on scans held out: how it was trained, what it expects, errors (k, b) [m]; those that count.

    A reading counts that is away from edges and no outlier: nobody expects those.
    """

    trained: ScanModel
    what: Expected
    error: FloatArray
    counts: BoolArray


def _side(split: Split, settings: Settings, truth: tuple[float, float] | None) -> _Side:
    trained = scattered(expected(split.train, settings), split.train.measured, settings, truth)
    what = expected(split.test, settings)
    error = split.test.measured - what.mean
    with np.errstate(invalid="ignore"):
        counts = what.place & (np.abs(error / trained.of(what)[1]) < _OUTLIER)
    return _Side(trained, what, error, counts)


def _splits(recording: Recording, model: Model, forecast: Forecast | None) -> Iterator[Split]:
    places = Places(recording, model, forecast)
    parts = places.trained()
    tests = [run for run in recording.runs if run.name in recording.test and run.pose]
    picked = [(run, *chosen(run, _SCANS)) for run in tests]
    held = [places.of(run, stamps, measured) for run, stamps, measured in picked if len(stamps)]
    if held:
        yield Split(joined(parts), joined(held), apart=True)
        return
    if len(parts) == 1:
        parts = _cut(parts[0], _PARTS)
    for i, part in enumerate(parts):
        rest = [other for j, other in enumerate(parts) if j != i]
        if rest:
            yield Split(joined(rest), part, apart=False)


def refit(shots: Shots, settings: Settings) -> Settings:
    """Return settings whose parameters are those that explain some shots best, near those given."""
    base = expected(shots, settings)
    error = shots.measured - base.mean
    sd = scattered(base, shots.measured, settings, None).of(base)[1]
    use = base.place & (np.abs(np.nan_to_num(error / sd, nan=np.inf)) < _OUTLIER)
    keys, columns, sizes = [], [], []
    for setting in settings:
        for p in effects.by_id(setting.id).parameters:
            size = abs(setting.parameters[p.name] - p.null)
            if size == 0 or p.lower == p.upper:
                continue
            moved = _with(settings, {(setting.id, p.name): _inside(p, setting.parameters[p.name] + _STEP * size)})
            change = (expected(shots, moved).mean - base.mean)[use] / sd[use]
            if np.isfinite(change).all() and np.any(change):
                keys.append((setting.id, p.name))
                columns.append(change / _STEP)
                sizes.append(size)
    if not keys:
        return settings
    j = np.column_stack(columns)
    shares = np.linalg.solve(j.T @ j + np.eye(len(keys)) / _VAGUE**2, j.T @ (error / sd)[use])
    known = {(setting.id, name): value for setting in settings for name, value in setting.parameters.items()}
    bounds = {(s.id, p.name): p for s in settings for p in effects.by_id(s.id).parameters}
    return _with(
        settings,
        {
            key: _inside(bounds[key], known[key] + share * size)
            for key, share, size in zip(keys, shares.tolist(), sizes, strict=True)
        },
    )


def _inside(parameter: effects.Parameter, value: float) -> float:
    return float(np.clip(value, parameter.lower, parameter.upper))


def _with(settings: Settings, values: dict[tuple[str, str], float]) -> Settings:
    return tuple(
        EffectSetting(s.id, {name: values.get((s.id, name), value) for name, value in s.parameters.items()})
        for s in settings
    )


def _cut(shots: Shots, parts: int) -> list[Shots]:
    return [rows_of(shots, rows) for rows in np.array_split(np.arange(len(shots.stamps)), parts) if len(rows)]
