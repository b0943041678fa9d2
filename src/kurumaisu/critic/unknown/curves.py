# SPDX-License-Identifier: BSD-3-Clause
"""Rivals of the catalogue: curves over something that is known of the drive, in case they explain it better.

A curve's coefficients are normal before the data, so its evidence is that of a linear model; its size and roughness
are weighed over a small grid. Occam decides: what a catalogue effect explains with one parameter, a curve explains
with eight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive, edges_of
from kurumaisu.critic.base.reference_sensitivity import reference_increments
from kurumaisu.critic.base.sensitivity import Sensitivity
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.unknown.bases import Basis, bases
from kurumaisu.critic.unknown.offset import OFFSET_CHANNELS, constant_offset
from kurumaisu.critic.unknown.periods import wave_periods
from kurumaisu.critic.values.prior import Z_HIGH, Z_LOW, Z_USUAL
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

# Sizes of a curve, whitened: with the catalogue's prior of the size of an effect, nine tenths up to Z_USUAL.
_SIZES = np.concatenate([np.geomspace(Z_LOW, Z_USUAL, 8), np.geomspace(Z_USUAL, Z_HIGH, 5)[1:]])
_LOG_WEIGHTS = np.log(np.concatenate([np.full(8, 0.9 / 8), np.full(4, 0.1 / 4)]))
# What a rate's factor may follow: over the rate itself it would be the sum of a rate and a curve again, and so would
# how the way bends over the speed.
_BRAKES = {
    "v_gain": (
        "w",
        "abs_w",
        "v_times_w",
        "time",
        "since_command",
        "since_rest",
        "since_reversal",
        "heading",
        "distance",
        "x",
        "y",
    ),
    "w_gain": (
        "v",
        "abs_v",
        "v_times_w",
        "time",
        "since_command",
        "since_rest",
        "since_reversal",
        "heading",
        "distance",
        "x",
        "y",
    ),
    "curvature": ("time", "since_reversal", "heading", "x", "y"),
    "speed": ("time", "heading", "x", "y"),
}


# What the errors of a reference may follow: of the place above all, as markers go out of sight and maps are bent. What
# it does over the time is the noise's, which may be slow.
_SEEN_OVER = {
    "reference_x": ("x", "y", "heading"),
    "reference_y": ("x", "y", "heading"),
    "reference_heading": ("x", "y", "heading", "v", "w"),
}


@dataclass(frozen=True)
class Curve:
    """A curve over a covariate in one channel; columns: where it stands among a design's."""

    channel: str
    basis: Basis
    columns: slice

    @property
    def id(self) -> str:
        """Return the id of the effect that it is."""
        return effects.smooth_id(self.channel, self.basis.covariate)


@dataclass(frozen=True)
class CurveEvidence:
    """Log evidence of a curve over its absence [nat]; prior (k, k): of its coefficients, at the best size."""

    nats: float
    prior: FloatArray


class Design:
    """The whitened columns of all curves about simulated drives."""

    def __init__(self, problem: Problem, settings: Sequence[EffectSetting]) -> None:
        taken = {setting.id for setting in problem.model.effects}
        self.curves: list[Curve] = []
        at = 0
        for basis in bases(problem.drives, problem.model, settings, wave_periods(problem, settings)):
            for channel in _channels(basis.covariate):
                if effects.smooth_id(channel, basis.covariate) not in taken:
                    self.curves.append(Curve(channel, basis, slice(at, at + basis.size)))
                    at += basis.size
        end = max((float(drive.times[-1] - drive.start) for drive in problem.drives), default=0.0)
        for channel in OFFSET_CHANNELS if self.curves else ():
            if effects.smooth_id(channel, effects.MOVING) not in taken:
                self.curves.append(Curve(channel, constant_offset(end), slice(at, at + 1)))
                at += 1
        self.columns = columns(problem, settings, self.curves)
        self.grams = [self.columns[:, c.columns].T @ self.columns[:, c.columns] for c in self.curves]


def _channels(covariate: str) -> Iterator[str]:
    """Yield the channels in which a curve over a covariate is tried; what was measured beside may act on all."""
    extra = covariate not in effects.COVARIATES
    for channel in effects.CHANNELS:
        if extra or covariate in _BRAKES.get(channel, (covariate,)):
            yield channel
    for channel, followed in _SEEN_OVER.items():
        if covariate in followed:
            yield channel


def columns(problem: Problem, settings: Sequence[EffectSetting], curves: Sequence[Curve]) -> FloatArray:
    """Return the whitened columns of curves about drives simulated with some effects, (rows, k)."""
    rows = [3 * (len(drive.times) - 1) for drive in problem.drives]
    out = np.empty((sum(rows), sum(curve.basis.size for curve in curves)))
    if not curves:  # a chair that never changes its rates follows nothing
        return out
    for drive, end in zip(problem.drives, np.cumsum(rows), strict=True):
        own = raw_columns(drive, problem.model, settings, curves)
        out[end - len(own) : end] = problem.whitened(drive, own)
    return out


def raw_columns(drive: Drive, model: Model, settings: Sequence[EffectSetting], curves: Sequence[Curve]) -> FloatArray:
    """Return the derivative of a drive's increments by the coefficients of curves, (3 m, k)."""
    motion = replay.motion(drive, model, settings)
    sensitivity = Sensitivity(drive, motion)
    matrices = {id(basis): basis.matrix(basis.samples(motion)) for basis in (curve.basis for curve in curves)}
    out = np.empty((3 * (len(drive.times) - 1), sum(curve.basis.size for curve in curves)))
    for curve, end in zip(curves, np.cumsum([curve.basis.size for curve in curves]), strict=True):
        if curve.channel in effects.REFERENCE_CHANNELS:
            errors = curve.basis.matrix(edges_of(curve.basis.samples(motion)))
            own = reference_increments(drive, motion, curve.channel, errors)
        else:
            own = sensitivity.increments(curve.channel, matrices[id(curve.basis)])
        out[:, end - curve.basis.size : end] = own
    return out


def curve_evidence(gram: FloatArray, b: FloatArray, priors: Sequence[FloatArray]) -> CurveEvidence:
    """Return how much a curve explains: b = X'y, gram = X'X of its whitened columns; any of the priors may hold."""
    return curve_evidences(gram[None], b[None], np.stack(priors)[None])[0]


def curve_evidences(grams: FloatArray, b: FloatArray, priors: FloatArray) -> list[CurveEvidence]:
    """Return how much each of several curves (n, k, k), (n, k) explains; priors (n, p, k, k), any of which may hold."""
    count = priors.shape[1]
    scaled, axes, sizes = _axes(np.repeat(grams, count, axis=0), priors.reshape(-1, *priors.shape[2:]))
    nats = _nats(sizes, (axes.transpose(0, 2, 1) @ np.repeat(b, count, axis=0)[..., None])[..., 0])
    weighed = (nats + _LOG_WEIGHTS).reshape(len(grams), -1)
    best = np.argmax(weighed, axis=1)
    totals = logsumexp(weighed, axis=1) - np.log(count)
    rows = count * np.arange(len(grams)) + best // len(_SIZES)
    found = zip(totals, rows, best % len(_SIZES), strict=True)
    return [CurveEvidence(float(total), _SIZES[size] ** 2 * scaled[row]) for total, row, size in found]


def _axes(gram: FloatArray, priors: Sequence[FloatArray] | FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return, for each prior: it, scaled to a signal of norm 1; its own axes in b, (k, k); the gram along them.

    gram (k, k) of all priors or (priors, k, k).
    """
    scaled = np.stack(list(priors))
    scaled = scaled / np.maximum(np.sum(gram * scaled, axis=(1, 2)), 1e-12)[:, None, None]
    values, vectors = np.linalg.eigh(scaled)
    root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    sizes, turns = np.linalg.eigh(root.transpose(0, 2, 1) @ gram @ root)
    return scaled, root @ turns, np.maximum(sizes, 0.0)


def _nats(sizes: FloatArray, c: FloatArray) -> FloatArray:
    """Return the log evidence for each of _SIZES, (..., sizes); sizes, c (..., k): gram and b along own axes."""
    spread = 1 + _SIZES[:, None] ** 2 * sizes[..., None, :]
    weights, squares = _SIZES[:, None] ** 2 / spread, c**2
    gained = squares @ weights.T if sizes.ndim == 1 else (weights @ squares[..., None])[..., 0]
    return np.asarray(0.5 * (gained - np.log(spread).sum(axis=-1)))
