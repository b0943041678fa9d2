# SPDX-License-Identifier: BSD-3-Clause
"""What an extension is worth on drives that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic import replay
from kurumaisu.critic.drive import Drive, split
from kurumaisu.critic.material import spans
from kurumaisu.critic.noise import Noise, whitened
from kurumaisu.critic.verdict import Gain, LogDensityGain, RmseGain
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

HORIZONS = (2.0, 5.0, 20.0)  # [s] over which the path is predicted from the inputs alone
_PARTS = 4  # of a single run, of which each is held out in turn
_BLOCK = 5.0  # [s] resampled as a whole: at least ten time constants of the usual process noise
_DRAWS = 2000


@dataclass(frozen=True)
class Fold:
    """Drives to fit and drives to judge by."""

    train: tuple[Drive, ...]
    test: tuple[Drive, ...]


@dataclass(frozen=True)
class Fitted:
    """What extends a model, as fitted to some drives.

    doubt: how the increments of a drive change, (3 m, k), by errors of the fit that are independent and normal with
    sd 1; None where they are too small to matter.
    """

    settings: Sequence[EffectSetting]
    doubt: Callable[[Drive], FloatArray] | None = None


Refit = Callable[[Sequence[Drive]], Fitted]


def folds(train: Sequence[Drive], test: Sequence[Drive]) -> list[Fold]:
    """Return train against test; without test runs, each run left out in turn; of a single run, each quarter.

    Nothing when a single run is too short to be cut.
    """
    if test:
        return [Fold(tuple(train), tuple(test))]
    parts = list(train) if len(train) > 1 else split(train[0], _PARTS)
    if len(parts) < 2:
        return []
    return [Fold(tuple(parts[:i] + parts[i + 1 :]), (parts[i],)) for i in range(len(parts))]


def measure(model: Model, splits: Sequence[Fold], refit: Refit, baseline: Noise, extended: Noise) -> Gain:
    """Return the gain of what extends a model; refit: returns it as fitted to each fold's training drives.

    baseline, extended: the noise that either model needs to explain the training data; a model that is wrong pays
    for it with wide predictions or with surprises.
    """
    density: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    errors: dict[float, tuple[list[FloatArray], list[FloatArray]]] = {horizon: ([], []) for horizon in HORIZONS}
    for fold in splits:
        extension = refit(fold.train)
        for drive in fold.test:
            for side, (fitted, noise) in enumerate(((Fitted(()), baseline), (extension, extended))):
                density[side].extend(_blocks(drive, _log_density(drive, model, fitted, noise)))
                for horizon in HORIZONS:
                    errors[horizon][side].extend(_open_loop(drive, model, fitted.settings, horizon))
    return Gain(
        _log_density_gain(*density),
        {f"position after {horizon:g} s": _rmse(*errors[horizon]) for horizon in HORIZONS if errors[horizon][0]},
    )


def _log_density(drive: Drive, model: Model, fitted: Fitted, noise: Noise) -> FloatArray:
    """Return the predictive log density of each increment given those before it, (m,) [nats]."""
    residual = drive.measured - replay.increments(drive, model, fitted.settings)
    columns = residual.reshape(-1, 1)
    if fitted.doubt is not None:
        columns = np.hstack([columns, fitted.doubt(drive)])
    white, log_determinants = whitened(drive, columns, noise)
    parts = white.reshape(-1, 3, white.shape[1])
    return np.asarray(_surprise(parts[:, :, 0], parts[:, :, 1:]) - 0.5 * (log_determinants + 3 * np.log(2 * np.pi)))


def _surprise(innovations: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the log density of whitened innovations (m, 3), up to a constant, with doubt along columns (m, 3, k).

    What an increment tells about the doubt is used for those after it.
    """
    if not columns.shape[2]:
        return np.asarray(-0.5 * (innovations**2).sum(axis=1))
    mean, spread = np.zeros(columns.shape[2]), np.eye(columns.shape[2])
    out = np.empty(len(innovations))
    for i, (seen, by) in enumerate(zip(innovations, columns, strict=True)):
        reach = by @ spread
        total = np.eye(3) + reach @ by.T
        left = seen - by @ mean
        weighed = np.linalg.solve(total, np.column_stack([left, reach]))
        out[i] = -0.5 * float(left @ weighed[:, 0] + np.linalg.slogdet(total)[1])
        mean, spread = mean + reach.T @ weighed[:, 0], spread - reach.T @ weighed[:, 1:]
    return out


def _blocks(drive: Drive, values: FloatArray) -> list[FloatArray]:
    """Return per-increment values cut into blocks of _BLOCK seconds."""
    index = ((drive.times[1:] - drive.times[0]) // _BLOCK).astype(int)
    return [values[index == i] for i in np.unique(index)]


def _open_loop(drive: Drive, model: Model, settings: Sequence[EffectSetting], horizon: float) -> list[FloatArray]:
    """Return squared position errors [m^2] after a horizon, per start, in blocks of starts that share data."""
    simulated = replay.path(drive, model, settings)
    starts, ends = spans(drive, horizon)
    predicted = geometry.between(simulated[starts], simulated[ends])
    measured = geometry.between(drive.poses[starts], drive.poses[ends])
    squares = ((predicted - measured)[:, :2] ** 2).sum(axis=1)
    index = ((drive.times[starts] - drive.times[0]) // max(_BLOCK, horizon)).astype(int)
    return [squares[index == i] for i in np.unique(index)]


def _resample(blocks: int) -> FloatArray:
    """Return bootstrap weights of blocks, (_DRAWS, blocks)."""
    rng = np.random.default_rng(0)
    return np.asarray(rng.multinomial(blocks, np.full(blocks, 1 / blocks), size=_DRAWS), dtype=np.float64)


def _log_density_gain(baseline: list[FloatArray], extended: list[FloatArray]) -> LogDensityGain:
    sums = np.array([[b.sum(), e.sum(), len(b)] for b, e in zip(baseline, extended, strict=True)])
    drawn = _resample(len(sums)) @ sums
    lo, hi = np.quantile((drawn[:, 1] - drawn[:, 0]) / drawn[:, 2], [0.05, 0.95])
    b, e = sums[:, :2].sum(axis=0) / sums[:, 2].sum()
    return LogDensityGain(float(b), float(e), float(e - b), float(lo), float(hi))


def _rmse(baseline: list[FloatArray], extended: list[FloatArray]) -> RmseGain:
    sums = np.array([[b.sum(), e.sum(), len(b)] for b, e in zip(baseline, extended, strict=True)])
    drawn = _resample(len(sums)) @ sums
    gains = np.sqrt(drawn[:, 0] / drawn[:, 2]) - np.sqrt(drawn[:, 1] / drawn[:, 2])
    lo, hi = np.quantile(gains, [0.05, 0.95])
    b, e = np.sqrt(sums[:, :2].sum(axis=0) / sums[:, 2].sum())
    return RmseGain(float(b), float(e), float(b - e), float(lo), float(hi), "m")
