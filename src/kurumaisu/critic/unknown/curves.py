# SPDX-License-Identifier: BSD-3-Clause
"""Rivals of the catalogue: curves over something that is known of the drive, in case they explain it better.

A curve's coefficients are normal before the data, so its evidence is that of a linear model; its size and roughness
are weighed over a small grid. Occam decides: what a catalogue effect explains with one parameter, a curve explains
with eight.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive, edges_of
from kurumaisu.critic.base.sensitivity import Sensitivity, reference_increments
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.unknown.bases import OFFSET_CHANNELS, Basis, bases, constant, root_of
from kurumaisu.critic.values.policy import Z_HIGH, Z_LOW, Z_USUAL
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

# Sizes of a curve, whitened: with the catalogue's prior of the size of an effect, nine tenths up to Z_USUAL.
_SIZES = np.concatenate([np.geomspace(Z_LOW, Z_USUAL, 8), np.geomspace(Z_USUAL, Z_HIGH, 5)[1:]])
_LOG_WEIGHTS = np.log(np.concatenate([np.full(8, 0.9 / 8), np.full(4, 0.1 / 4)]))
# What a rate's factor may follow: over the rate itself it would be the sum of a rate and a curve again, and so would
# how the way bends over the speed.
_OVER = ("v_times_w", "time", "since_command", "since_rest", "since_reversal", "heading", "distance", "x", "y")
_BRAKES = {
    "v_gain": ("w", "abs_w", *_OVER),
    "w_gain": ("v", "abs_v", *_OVER),
    "curvature": ("time", "since_reversal", "heading", "x", "y"),
    "speed": ("time", "heading", "x", "y"),
}

ALIKE = 0.9  # correlation with an effect's signal from which a curve draws that effect
AS_ALIKE = 0.01  # by which the correlation with another one's may be less, and nobody knows which of both it draws
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
                self.curves.append(Curve(channel, constant(end), slice(at, at + 1)))
                at += 1
        self.columns = columns(problem, settings, self.curves)
        self.single = self.columns.astype(np.float32)
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
    root = root_of(scaled)
    sizes, turns = np.linalg.eigh(root.transpose(0, 2, 1) @ gram @ root)
    return scaled, root @ turns, np.maximum(sizes, 0.0)


def _nats(sizes: FloatArray, c: FloatArray) -> FloatArray:
    """Return the log evidence for each of _SIZES, (..., sizes); sizes, c (..., k): gram and b along own axes."""
    spread = 1 + _SIZES[:, None] ** 2 * sizes[..., None, :]
    weights, squares = _SIZES[:, None] ** 2 / spread, c**2
    gained = squares @ weights.T if sizes.ndim == 1 else (weights @ squares[..., None])[..., 0]
    return np.asarray(0.5 * (gained - np.log(spread).sum(axis=-1)))


# Girths of casters and drive wheels, and more: a wheel out of round takes a share of the way, a bent caster turns the
# chair. People who sway, pumps and fans; tiles, seams and ramps of a floor.
# Of waves over a covariate the shortest and longest, in its unit, and in which channels they are looked for.
Wave = tuple[float, float, tuple[str, ...]]
WAVES: Mapping[str, Wave] = {
    "distance": (0.3, 3.0, ("v_gain", "w")),
    "time": (2.0, 60.0, ("v_gain", "w")),
    "x": (0.3, 3.0, ("v_gain", "curvature")),
    "y": (0.3, 3.0, ("v_gain", "curvature")),
}
_TURNS = 3.0  # in all of a drive, at least: fewer are a slope or a carpet
_MOST = 150  # periods, all over the whole of a part of the way
_AT_ONCE = 16  # of them: more leave the processor's cache
_OVERTONES = 4
_PARTS = (1, 2, 3)  # of a turn, after which it may be as large as after all of it
_CLOSER = 8  # periods for one about the best: an overtone is out of step sooner


def wave_periods(problem: Problem, settings: Sequence[EffectSetting]) -> dict[str, tuple[float, int]]:
    """Return the period of waves over each covariate that explain most beside effects, and out of how many.

    None of a covariate that no drive goes through often enough.
    """
    motions = [replay.motion(drive, problem.model, settings) for drive in problem.drives]
    left = [drive.measured - problem.simulated(drive, settings) for drive in problem.drives]
    white = [problem.whitened(drive, one.reshape(-1, 1))[:, 0] for drive, one in zip(problem.drives, left, strict=True)]
    sensitive = [Sensitivity(drive, motion) for drive, motion in zip(problem.drives, motions, strict=True)]
    found = {}
    for name, kind in WAVES.items():
        along = [effects.Follower(name, 0.0).values(motion) for motion in motions]
        sought = list(zip(problem.drives, sensitive, along, white, strict=True))
        far = max((float(np.ptp(one)) for one in along if len(one)), default=0.0)
        period = _wave_period(problem, sought, kind, far)
        if period is not None:
            found[name] = period
    return found


# A drive with how it reacts, the covariate along it, and what is left of it, whitened.
_Along = tuple[Drive, Sensitivity, FloatArray, FloatArray]


def _wave_period(problem: Problem, drives: Sequence[_Along], kind: Wave, far: float) -> tuple[float, int] | None:
    """Return the period that explains most, and out of how many; far: as a drive goes at most."""
    shortest, longest, channels = kind
    if far < _TURNS * shortest:
        return None
    low, high = max(1 / longest, _TURNS / far), 1 / shortest
    # Over more of the way than this, so many periods would be out of step with one between them.
    part = min(far, 0.5 * _MOST / (high - low))
    waves = np.linspace(low, high, max(int(2 * part * (high - low)), 2))
    gained = np.stack([_gained(problem, drives, channel, waves, 1, part) for channel in channels])
    channel, best = np.unravel_index(int(np.argmax(gained)), gained.shape)
    # What comes once per turn, but briefly, has overtones as large, any of which may stand out.
    times = int(np.ceil(_CLOSER * far / part))
    apart, closer = waves[1] - waves[0], np.arange(-times, times + 1) / times
    near = [(waves[best] + apart * closer) / turns for turns in _PARTS]
    near = [some[(some >= low) & (some <= high)] for some in near]
    found = [(w, _gained(problem, drives, channels[channel], w, _OVERTONES, np.inf)) for w in near if len(w) > 1]
    likeliest, _ = max(((wave[np.argmax(g)], g.max()) for wave, g in found), key=lambda one: one[1])
    return float(1 / likeliest), round(gained.size * far / part)


def _gained(
    problem: Problem, drives: Sequence[_Along], channel: str, waves: FloatArray, overtones: int, part: float
) -> FloatArray:
    """Return the squares that each of evenly spaced waves, with as many overtones, explains in a channel, (n,).

    part: of the covariate, in whose next one a wave may have any other phase.
    """
    size = 2 * overtones
    grams: dict[int, FloatArray] = {}
    pulls: dict[int, FloatArray] = {}
    for drive, sensitivity, way, white in drives:
        middles = (0.5 * (drive.times[1:] + drive.times[:-1]) - drive.start) / GRID
        parts = np.repeat(np.floor(way[np.clip(middles.astype(int), 0, len(way) - 1)] / part), 3).astype(int)
        tones = zip(*(_waves(way, times * waves) for times in range(1, overtones + 1)), strict=True)
        at = 0
        for some in tones:
            here = slice(at, at + some[0].shape[1] // 2)
            at = here.stop
            # (rows, waves, cosines and sines of all tones)
            whole = [
                problem.whitened(drive, sensitivity.increments(channel, tone)).reshape(len(white), -1, 2)
                for tone in some
            ]
            both = whole[0] if overtones == 1 else np.concatenate(whole, axis=2)
            for key in np.unique(parts).tolist():
                own, left = both[parts == key], white[parts == key]
                gram = grams.setdefault(key, np.zeros((len(waves), size, size)))
                gram[here] += np.einsum("nki,nkj->kij", own, own)
                pulls.setdefault(key, np.zeros((len(waves), size)))[here] += np.einsum("nki,n->ki", own, left)
    out = np.zeros(len(waves))
    for key, pull in pulls.items():
        along = np.linalg.solve(grams[key] + 1e-9 * np.eye(size), pull[..., None])[..., 0]
        out += np.einsum("ki,ki->k", pull, along)
    return out


def _waves(way: FloatArray, waves: FloatArray) -> Iterator[FloatArray]:
    """Yield pairs of cosine and sine (n, 2 k) of evenly spaced waves along a way (n,), few at a time.

    Each is the one before it, turned on by as much again.
    """
    first, apart = np.exp(2j * np.pi * np.multiply.outer([waves[0], waves[1] - waves[0]], way))
    for at in range(0, len(waves), _AT_ONCE):
        turned = np.empty((len(way), min(_AT_ONCE, len(waves) - at)), dtype=complex)
        turned[:, 0] = first
        turned[:, 1:] = apart[:, None]
        np.cumprod(turned, axis=1, out=turned)
        first = turned[:, -1] * apart
        yield turned.view(np.float64)
