# SPDX-License-Identifier: BSD-3-Clause
"""What an extension is worth on drives that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive, pieces, split
from kurumaisu.critic.base.sensitivity import free_columns
from kurumaisu.critic.heldout.materiality import spans
from kurumaisu.critic.noise.base_noise import Noise, whitened
from kurumaisu.critic.predict.motion import Paths, motion_ahead
from kurumaisu.critic.values.verdict import ChannelGain, Gain, LogDensityGain, RmseGain
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

INCREMENT_CHANNELS = {"dx": "m", "dy": "m", "dtheta": "rad"}
HORIZONS = (2.0, 5.0, 20.0)  # [s] over which the path is predicted from the inputs alone
PARTS = 4  # of a single run, of which each is held out in turn
BLOCK = 5.0  # [s] resampled as a whole: at least ten time constants of the usual process noise
_DRAWS = 2000
_GAP = 1.0  # [s] between poses, beyond which poses are withheld
_STARTS = 8  # per drive and horizon


@dataclass(frozen=True)
class Fold:
    """Drives to fit and drives to judge by."""

    train: tuple[Drive, ...]
    test: tuple[Drive, ...]


@dataclass(frozen=True)
class FittedExtension:
    """What extends a model, as fitted to some drives.

    doubt: how the increments of a drive change, (3 m, k), by errors of the fit that are independent and normal with
    sd 1; None where they are too small to matter.
    """

    settings: Sequence[EffectSetting]
    doubt: Callable[[Drive], FloatArray] | None = None


Sides = tuple[list[FloatArray], list[FloatArray]]  # blocks of values by the baseline and by the extended model
Refit = Callable[[Sequence[Drive]], FittedExtension]


def folds(train: Sequence[Drive], test: Sequence[Drive]) -> list[Fold]:
    """Return train against test; without test runs, each run left out in turn; of a single run, each quarter.

    Nothing when a single run is too short to be cut.
    """
    if test:
        return [Fold(tuple(train), tuple(test))]
    parts = list(train) if len(train) > 1 else split(train[0], PARTS)
    if len(parts) < 2:
        return []
    return [Fold(tuple(parts[:i] + parts[i + 1 :]), (parts[i],)) for i in range(len(parts))]


def with_withheld(splits: list[Fold], train: Sequence[Drive], withheld: Sequence[Drive]) -> list[Fold]:
    """Return folds and, as one more, what is known of withheld drives; their gaps are not for judging by."""
    parts = tuple(part for drive in withheld for part in pieces(drive, _GAP))
    return [*splits, Fold(tuple(train), parts)] if parts else splits


def measure(model: Model, splits: Sequence[Fold], refit: Refit, baseline: Noise, extended: Noise) -> Gain:
    """Return the gain of what extends a model; refit: returns it as fitted to each fold's training drives.

    baseline, extended: the noise that either model needs to explain the training data; a model that is wrong pays
    for it with wide predictions or with surprises.
    """
    density: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    errors: dict[float, tuple[list[FloatArray], list[FloatArray]]] = {horizon: ([], []) for horizon in HORIZONS}
    floors: dict[float, list[float]] = {horizon: [] for horizon in HORIZONS}
    for fold in splits:
        extension = refit(fold.train)
        for drive in fold.test:
            for horizon, floor in _squares_by_noise(drive, model, extension.settings, extended):
                floors[horizon].append(floor)
            for side, (fitted, noise) in enumerate(((FittedExtension(()), baseline), (extension, extended))):
                density[side].extend(
                    blocks(_log_density(drive, model, fitted, noise), drive.times[1:] - drive.times[0])
                )
                for horizon in HORIZONS:
                    errors[horizon][side].extend(_open_loop(drive, model, fitted.settings, horizon))
    rmse = {
        f"position after {horizon:g} s": replace(
            rmse_gain(*_columns(errors[horizon], slice(0, 2)), "m"),
            achievable=float(np.sqrt(np.mean(floors[horizon]))) if floors[horizon] else None,
        )
        for horizon in HORIZONS
        if errors[horizon][0]
    }
    near = errors[HORIZONS[0]]
    channels = {
        name: ChannelGain(
            log_density_gain(*_columns(density, slice(i, i + 1))),
            rmse_gain(*_columns(near, slice(i, i + 1)), unit) if near[0] else None,
        )
        for i, (name, unit) in enumerate(INCREMENT_CHANNELS.items())
    }
    return Gain(log_density_gain(*_columns(density, slice(0, 3))), rmse, channels)


def _columns(sides: Sides, which: slice) -> Sides:
    """Return blocks (m,) of both sides, some columns of them added up."""
    baseline, extended = ([block[:, which].sum(axis=1) for block in side] for side in sides)
    return baseline, extended


def _log_density(drive: Drive, model: Model, fitted: FittedExtension, noise: Noise) -> FloatArray:
    """Return the log density of each increment given those before it, (m, 3): dx, dy given dx, dtheta [nats]."""
    residual = drive.measured - replay.increments(drive, model, fitted.settings)
    residual[:, 2] = geometry.wrap(residual[:, 2])  # across a gap nobody counted the turns
    columns = np.hstack([residual.reshape(-1, 1), free_columns(drive, model)])
    if fitted.doubt is not None:
        columns = np.hstack([columns, fitted.doubt(drive)])
    white, log_determinants = whitened(drive, columns, noise)
    parts = white.reshape(-1, 3, white.shape[1])
    return np.asarray(_surprise(parts[:, :, 0], parts[:, :, 1:]) - 0.5 * (log_determinants + np.log(2 * np.pi)))


def _surprise(innovations: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the log density of whitened innovations (m, 3), up to a constant, with doubt along columns (m, 3, k).

    What an increment tells about the doubt is used for those after it.
    """
    if not columns.shape[2]:
        return np.asarray(-0.5 * innovations**2)
    mean, spread = np.zeros(columns.shape[2]), np.eye(columns.shape[2])
    out = np.empty_like(innovations)
    for i, (seen, by) in enumerate(zip(innovations, columns, strict=True)):
        reach = by @ spread
        root = np.linalg.cholesky(np.eye(3) + reach @ by.T)
        weighed = np.linalg.solve(root, np.column_stack([seen - by @ mean, reach]))
        out[i] = -0.5 * weighed[:, 0] ** 2 - np.log(np.diag(root))
        mean, spread = mean + weighed[:, 1:].T @ weighed[:, 0], spread - weighed[:, 1:].T @ weighed[:, 1:]
    return out


def blocks(values: FloatArray, since: FloatArray, length: float = BLOCK) -> list[FloatArray]:
    """Return values (n, ...) cut into blocks of so many seconds; since (n,) [s]: when each is, since the beginning."""
    index = (since // length).astype(int)
    return [values[index == i] for i in np.unique(index)]


def _open_loop(drive: Drive, model: Model, settings: Sequence[EffectSetting], horizon: float) -> list[FloatArray]:
    """Return squared errors (m, 3) of dx, dy [m^2] and dtheta [rad^2] after a horizon, in blocks that share data."""
    simulated = replay.path(drive, model, settings)
    starts, ends = spans(drive, horizon)
    predicted = geometry.between(simulated[starts], simulated[ends])
    measured = geometry.between(drive.poses[starts], drive.poses[ends])
    squares = np.square(predicted - measured)
    squares[:, 2] = np.square(geometry.wrap(predicted[:, 2] - measured[:, 2]))
    return blocks(squares, drive.times[starts] - drive.times[0], max(BLOCK, horizon))


def _drawn(baseline: list[FloatArray], extended: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return sums of both sides and counts of blocks (m, 3), and the same (_DRAWS, 3) of blocks drawn again."""
    sums = np.array([[b.sum(), e.sum(), b.size] for b, e in zip(baseline, extended, strict=True)])
    weights = np.random.default_rng(0).multinomial(len(sums), np.full(len(sums), 1 / len(sums)), size=_DRAWS)
    return sums, weights.astype(np.float64) @ sums


def log_density_gain(baseline: list[FloatArray], extended: list[FloatArray]) -> LogDensityGain:
    """Return the gain per sample from blocks of log densities; blocks are resampled whole for its interval."""
    sums, drawn = _drawn(baseline, extended)
    lo, hi = np.quantile((drawn[:, 1] - drawn[:, 0]) / drawn[:, 2], [0.05, 0.95])
    b, e = sums[:, :2].sum(axis=0) / sums[:, 2].sum()
    return LogDensityGain(float(b), float(e), float(e - b), float(lo), float(hi))


def rmse_gain(baseline: list[FloatArray], extended: list[FloatArray], unit: str) -> RmseGain:
    """Return the gain from blocks of squared errors; blocks are resampled whole for its interval."""
    sums, drawn = _drawn(baseline, extended)
    gains = np.sqrt(drawn[:, 0] / drawn[:, 2]) - np.sqrt(drawn[:, 1] / drawn[:, 2])
    lo, hi = np.quantile(gains, [0.05, 0.95])
    b, e = np.sqrt(sums[:, :2].sum(axis=0) / sums[:, 2].sum())
    return RmseGain(float(b), float(e), float(b - e), float(lo), float(hi), unit)


def _squares_by_noise(
    drive: Drive, model: Model, settings: Sequence[EffectSetting], noise: Noise
) -> Iterator[tuple[float, float]]:
    """Yield horizons [s] and mean squared errors of the position [m^2] that noise alone makes, from some poses.

    From one pose as the reference gives it to another: nothing is known of how the noise was before.
    """
    paths = Paths(drive, model, tuple(settings), ())
    for horizon in HORIZONS:
        starts, ends = spans(drive, horizon)
        few = np.unique(np.linspace(0, len(starts) - 1, _STARTS).astype(int)) if len(starts) else []
        for i in few:
            row = slice(starts[i], starts[i] + 1)
            alone = drive.seen_at(drive.times[row], drive.poses[row])
            begin, end = float(drive.times[starts[i]]), float(drive.times[ends[i]])
            _, covariance = motion_ahead(alone, paths.at, noise, begin, end)
            yield horizon, float(covariance[0, 0] + covariance[1, 1])
