# SPDX-License-Identifier: BSD-3-Clause
"""What effects on the laser are worth on scans that they were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.heldout.drive_gain import PARTS, log_density_gain, rmse_gain
from kurumaisu.critic.predict.motion import Forecast
from kurumaisu.critic.predict.scan import (
    OUTLIER,
    Expected,
    ScanModel,
    expected_from,
    log_density,
    scattered,
    shifted_hits,
    without_random,
)
from kurumaisu.critic.predict.scan_poses import ScanPoses, chosen, joined
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots
from kurumaisu.critic.ranges.scans.gathering import why_not_usable
from kurumaisu.critic.values.criticism import Settings
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import ChannelGain
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import BoolArray, FloatArray, IntArray

RANGE_CHANNEL = "range"
_SCANS = 60  # of test runs
_BLOCK = 5  # scans resampled as a whole: neighbours share the errors of their poses
_STEP = 0.05  # of a parameter, as a share of its distance from the null, to see what it does
_PARTS_OF_STEP = (1.0, 0.5, 0.25, 0.125)  # that are tried
_VAGUE = 1.0  # sd of a parameter before it is fitted again, as a share of the same

_Value = TypeVar("_Value")
_Key = tuple[str, str]  # an effect and a parameter of it
_MOST = 24  # models whose expectations are kept: 3 MB each for 60 scans
_PLACES = 2  # likewise of what beams meet: 18 MB


@dataclass(frozen=True)
class Split:
    """Scans to fit and scans to judge by, as rows of those known; apart: the latter did not find what extends."""

    known: Expectations
    train: IntArray
    test: IntArray
    apart: bool


def measure(recording: Recording, model: Model, forecast: Forecast | None, settings: Settings) -> ChannelGain | None:
    """Return the gain per reading of what extends a model's laser; None where there is nothing to measure it on.

    forecast: of the base, None where nothing drove it; settings: the laser's and the map's.
    """
    if not settings or why_not_usable(recording) is not None:
        return None
    sums: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    squares: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    for split in _splits(recording, model, forecast):
        refitted = settings if split.apart else _refit(split.known, split.train, settings)
        sides = [_side(split, some) for some in ((), refitted)]
        use = sides[0].counts & sides[1].counts
        for i, side in enumerate(sides):
            density = log_density(side.what, side.error, use, side.trained.factors)
            for rows in np.array_split(np.arange(len(use)), max(len(use) // _BLOCK, 1)):
                if count := int(use[rows].sum()):
                    sums[i].append(np.full(count, density[rows].sum() / count))
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


def _side(split: Split, settings: Settings) -> _Side:
    measured = split.known.shots.measured
    trained = scattered(split.known.rows(settings, split.train), measured[split.train], settings)
    what = split.known.rows(settings, split.test)
    error = measured[split.test] - what.mean
    with np.errstate(invalid="ignore"):
        counts = what.place & (np.abs(error / trained.of(what)[1]) < OUTLIER)
    return _Side(trained, what, error, counts)


def _splits(recording: Recording, model: Model, forecast: Forecast | None) -> Iterator[Split]:
    places = ScanPoses(recording, model, forecast)
    parts = [shots for _, shots in places.trained_runs()]
    tests = [run for run in recording.runs if run.name in recording.test and run.pose]
    picked = [(run, *chosen(run, _SCANS)) for run in tests]
    held = [places.of(run, stamps, measured) for run, stamps, measured in picked if len(stamps)]
    if held:
        sizes = len(joined(parts).stamps), len(joined(held).stamps)
        rows = np.arange(sum(sizes))
        yield Split(Expectations(joined([*parts, *held])), rows[: sizes[0]], rows[sizes[0] :], apart=True)
        return
    known = Expectations(joined(parts))
    rows = np.arange(len(known.shots.stamps))
    if len(parts) == 1:
        cuts = [part for part in np.array_split(rows, PARTS) if len(part)]
    else:
        cuts = np.split(rows, np.cumsum([len(part.stamps) for part in parts[:-1]]))
    for test in cuts:
        if len(test) < len(rows):
            yield Split(known, np.setdiff1d(rows, test), test, apart=False)


def refit(shots: Shots, settings: Settings) -> Settings:
    """Return settings whose parameters are those that explain some shots best, near those given."""
    return _refit(Expectations(shots), np.arange(len(shots.stamps)), settings)


def _refit(known: Expectations, rows: IntArray, settings: Settings) -> Settings:
    """Return the same for some of the scans: a step along the line on which readings follow the sizes, or a part of it.

    Sizes that few scans tell from each other go far on it, where readings do not follow it.
    """
    base, measured = known.rows(settings, rows), known.shots.measured[rows]
    sd = scattered(base, measured, settings).of(base)[1]
    z = (measured - base.mean) / sd
    use = base.place & (np.abs(np.nan_to_num(z, nan=np.inf)) < OUTLIER)
    at = {(setting.id, name): value for setting in settings for name, value in setting.parameters.items()}
    bounds = {(s.id, p.name): p for s in settings for p in effects.by_id(s.id).parameters}
    columns: dict[_Key, FloatArray] = {}
    for key, p in bounds.items():
        if (size := abs(at[key] - p.null)) and p.lower != p.upper:
            moved = _with(settings, {key: _inside(p, at[key] + _STEP * size)})
            column = ((known.rows(moved, rows).mean - base.mean) / sd)[use] / _STEP
            if np.isfinite(column).all() and np.any(column):
                columns[key] = column
    if not columns:
        return settings
    j = np.column_stack(list(columns.values()))
    shares = np.linalg.solve(j.T @ j + np.eye(len(columns)) / _VAGUE**2, j.T @ z[use])
    steps = {key: share * abs(at[key] - bounds[key].null) for key, share in zip(columns, shares.tolist(), strict=True)}

    def stepped(part: float) -> Settings:
        return _with(settings, {key: _inside(bounds[key], at[key] + part * step) for key, step in steps.items()})

    def misfit(some: Settings) -> float:
        off = (measured - known.rows(some, rows).mean)[use] / sd[use]
        return float(np.sum(np.minimum(np.nan_to_num(off, nan=OUTLIER) ** 2, OUTLIER**2)))

    return min((settings, *map(stepped, _PARTS_OF_STEP)), key=misfit)


def _inside(parameter: effects.Parameter, value: float) -> float:
    return float(np.clip(value, parameter.lower, parameter.upper))


def _with(settings: Settings, values: dict[_Key, float]) -> Settings:
    return tuple(
        EffectSetting(s.id, {name: values.get((s.id, name), value) for name, value in s.parameters.items()})
        for s in settings
    )


class Expectations:
    """Expected readings of some shots; no scan's depend on which others there are."""

    def __init__(self, shots: Shots) -> None:
        self.shots = shots
        self._own = {setting.id for setting in shots.own}
        self._plain: dict[Hashable, Settings] = {}
        self._expected: dict[Hashable, Expected] = {}
        self._looks: dict[Hashable, list[BeamHits]] = {}

    def of(self, settings: Settings) -> Expected:
        """Return what the shots are to read with these effects."""
        plain = _known(self._plain, settings, np.inf, lambda: tuple(without_random(self.shots, settings)))
        return _known(self._expected, plain, _MOST, lambda: expected_from(self.shots, plain, self._seen(plain)))

    def rows(self, settings: Settings, rows: IntArray) -> Expected:
        """Return the same of some of the scans."""
        what = self.of(settings)
        return Expected(what.mean[rows], what.parts[:, rows], what.shared[rows], what.place[rows])

    def _seen(self, settings: Settings) -> list[BeamHits]:
        """Return looks, which effects that act on readings alone do not change."""
        reads = [issubclass(effects.by_id(each.id), effects.ReadingEffect) for each in settings]
        placing = [one for one, alone in zip(settings, reads, strict=True) if one.id in self._own or not alone]
        return _known(self._looks, placing, _PLACES, lambda: shifted_hits(self.shots, settings))


def _known(
    known: dict[Hashable, _Value], by: Sequence[EffectSetting], most: float, make: Callable[[], _Value]
) -> _Value:
    """Return what is known by some effects, made if need be; most: that are kept, besides the first.

    That is what is without effects, to which all are compared.
    """
    key = tuple((each.id, tuple(sorted(each.parameters.items()))) for each in by)
    if key not in known:
        found = make()
        if len(known) >= most:
            del known[list(known)[1]]
        known[key] = found
    return known[key]
