# SPDX-License-Identifier: BSD-3-Clause
"""Curves over covariates: hats between knots, or sines and cosines, and how curved they are before the data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_HATS = 8
_HARMONICS = 4
_FEWEST = 50  # samples of the grid on which a quantity is known while the chair moves
_TURN = 2 * np.pi
_ROUNDING = 1e-6  # of a quantity's size: less spread is none
# Before the data, neighbouring knots differ at random (1), or so do neighbouring slopes (2): rough or smooth.
_ORDERS = (1, 2)
_FINE = 3  # knots, or waves, for one, of curves that the data may well bend so often
OFFSET_CHANNELS = (
    "v",
    "lateral",
    "w",
)  # a share of a rate that is off by as much everywhere is a gain of the catalogue


@dataclass(frozen=True)
class Basis:
    """The curves over one covariate.

    knots: of the hats, empty where periodic, one of a constant, which is pictured over the time;
    constants: the parameter that the covariate needs to be computed, if any;
    priors: covariances of the coefficients, (k, k) each, of a curve whose mean square over the drives is 1;
    low, high: the covariate lies between them in 95 % of the time that the chair moves. ways: out of how many like it
    this one was chosen by the data; harmonics: waves of a periodic one.
    """

    covariate: str
    knots: FloatArray
    constants: dict[str, float]
    priors: tuple[FloatArray, ...]
    low: float
    high: float
    ways: int = 1
    harmonics: int = _HARMONICS

    @property
    def size(self) -> int:
        """Return the number of coefficients."""
        return len(self.knots) or 1 + 2 * self.harmonics

    def samples(self, motion: effects.Motion) -> FloatArray:
        """Return the covariate of a motion from its start on, (n,); inf where there is none yet."""
        return np.asarray(effects.Follower(self.covariate, next(iter(self.constants.values()), 0.0)).values(motion))

    def matrix(self, at: FloatArray) -> FloatArray:
        """Return the basis at values of the covariate (n,), (n, k)."""
        if len(self.knots) == 1:
            return np.ones((len(at), 1))
        if len(self.knots):
            inside = np.clip(at, self.knots[0], self.knots[-1])
            below = np.clip(np.searchsorted(self.knots, inside, side="right") - 1, 0, len(self.knots) - 2)
            share = (inside - self.knots[below]) / (self.knots[below + 1] - self.knots[below])
            rows, hats = np.arange(len(at)), np.zeros((len(at), len(self.knots)))
            hats[rows, below], hats[rows, below + 1] = 1 - share, share
            return hats
        phase = np.multiply.outer(_TURN * at / self.constants.get("period", 0.0), np.arange(1, self.harmonics + 1))
        return np.column_stack([np.ones(len(at)), np.cos(phase), np.sin(phase)])

    def fine(self, motions: Sequence[effects.Motion]) -> Basis | None:
        """Return the curves over the same that bend _FINE times as often, with their prior over these motions.

        None where these do not vary in it between the knots: effects may have moved a single speed beyond them.
        """
        count = len(self.knots)
        at = np.linspace(0, count - 1, _FINE * (count - 1) + 1) if count else np.empty(0)
        knots = np.interp(at, np.arange(count), self.knots) if count else self.knots
        finer = replace(self, knots=knots, harmonics=_FINE * self.harmonics, priors=())
        matrix = finer.matrix(np.concatenate([finer.samples(motion)[motion.moving] for motion in motions]))
        if np.ptp(matrix, axis=0).max() <= _ROUNDING:
            return None
        return replace(finer, priors=tuple(priors_of(finer.knots, matrix)))

    def parameters(self, coefficients: FloatArray) -> dict[str, float]:
        """Return the parameters of the curve as a model file has them."""
        numbers = [float(c) for c in coefficients]
        if len(self.knots):
            named = {f"knot_{i}": float(knot) for i, knot in enumerate(self.knots)}
            return {**self.constants, **named, **{f"value_{i}": c for i, c in enumerate(numbers)}}
        cosines = {f"cos_{i}": c for i, c in enumerate(numbers[1 : 1 + self.harmonics], 1)}
        sines = {f"sin_{i}": c for i, c in enumerate(numbers[1 + self.harmonics :], 1)}
        return {**self.constants, "level": numbers[0], **cosines, **sines}


def bases(
    drives: Sequence[Drive], model: Model, settings: Sequence[EffectSetting], waves: Mapping[str, tuple[float, int]]
) -> Iterator[Basis]:
    """Yield the curves over every covariate that varies in these drives, as simulated with some effects.

    waves: periods of covariates over which waves are looked for, and out of how many they were chosen.
    """
    motions = [replay.motion(drive, model, settings) for drive in drives]
    usual = {"x", "y", "heading", "v_f", "v_s", effects.LATE}
    extras = set.intersection(*(set(drive.known) for drive in drives)) - usual
    # Rows of odometry are no commands: the time since the last one says how the rows are spaced, and nothing else.
    measured = any(drive.source == "odom" for drive in drives)
    plain = (name for name in (*effects.COVARIATES, *sorted(extras)) if name != "distance")  # that has waves alone
    asked = [(name, _constants(name, drives, model), 1) for name in plain]
    asked += [(name, {"period": period}, ways) for name, (period, ways) in waves.items()]
    for name, constants, ways in asked:
        if measured and name == "since_command":
            continue
        bare = Basis(name, np.empty(0), constants, (), 0.0, 0.0, ways)
        pooled = np.concatenate([bare.samples(motion)[motion.moving] for motion in motions])
        known = pooled[np.isfinite(pooled)]
        if len(known) < _FEWEST or np.ptp(known) <= _ROUNDING * max(1.0, float(np.abs(known).max())):
            continue
        low, high = np.quantile(known, [0.025, 0.975]).tolist()
        knots = np.empty(0) if "period" in constants else knots_of(known)
        if "period" in constants or len(knots) >= 3:
            basis = replace(bare, knots=knots, low=low, high=high)
            yield replace(basis, priors=tuple(priors_of(knots, basis.matrix(pooled))))


def _constants(name: str, drives: Sequence[Drive], model: Model) -> dict[str, float]:
    """Return the parameter that a covariate needs besides its curve, by name; of an extra one, its mean."""
    constant = effects.constant_of(name)
    if constant is None:
        return {}
    if constant == "track":
        return {constant: model.chassis.track}
    if constant == "period":
        return {constant: _TURN}
    return {constant: float(np.mean(np.concatenate([drive.known[name] for drive in drives])))}


def knots_of(values: FloatArray, hats: int = _HATS) -> FloatArray:
    """Return knots half way between evenly spaced ones and ones with as many samples between them.

    None where nearly all values are one, but for rounding.
    """
    low, high = np.quantile(values, [0.01, 0.99])
    if high - low <= _ROUNDING * max(1.0, abs(low), abs(high)):
        return np.empty(0)
    inside = np.clip(values, low, high)
    knots = 0.5 * (np.linspace(low, high, hats) + np.quantile(inside, np.linspace(0, 1, hats)))
    keep = np.append(True, np.diff(knots) > 1e-3 * (high - low))
    return np.asarray(knots[keep])


def root_of(prior: FloatArray) -> FloatArray:
    """Return R of a covariance R R' (k, k), or of several of them."""
    values, vectors = np.linalg.eigh(prior)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def priors_of(knots: FloatArray, matrix: FloatArray) -> Iterator[FloatArray]:
    """Yield covariances of the coefficients, without and with a level of their own, for each order.

    A curve without a level has mean 0 over the drives.
    """
    gram, mean = matrix.T @ matrix / len(matrix), matrix.mean(axis=0)
    for order in _ORDERS:
        if len(knots):
            centre = np.eye(len(knots)) - np.outer(np.ones(len(knots)), mean)
            bare = centre @ _walk(knots, order) @ centre.T
            level = np.ones((len(knots), len(knots)))
        else:
            weights = np.arange(1, matrix.shape[1] // 2 + 1.0) ** (-2 * order)
            bare = np.diag(np.concatenate([[0.0], weights, weights]))
            level = np.diag(np.eye(len(bare))[0])
        bare = bare / np.sum(gram * bare)
        yield bare
        yield (bare + level) / 2


def _walk(knots: FloatArray, order: int) -> FloatArray:
    """Return the covariance of a random walk over knots, or of the integral of one that starts with any slope."""
    s = (knots - knots[0]) / (knots[-1] - knots[0])
    low, high = np.minimum.outer(s, s), np.maximum.outer(s, s)
    return np.asarray(low if order == 1 else np.outer(s, s) + low**2 * (3 * high - low) / 6 * 4)


def constant(seconds: float) -> Basis:
    """Return one number while the chair moves, as known of drives of so many seconds."""
    return Basis(effects.MOVING, np.zeros(1), {}, (np.eye(1),), 0.0, seconds)
