# SPDX-License-Identifier: BSD-3-Clause
"""Errors of gyroscopes and accelerometers: the terms of IEEE Std 952, in continuous time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class InertialErrorSettings:
    """Errors of one kind of sensor; u is rad/s for gyroscopes, m/s^2 for accelerometers.

    noise_density: white noise (angle or velocity random walk) [u / sqrt(Hz)]; bias: deviation of the bias at power-up
    [u]; instability: deviation of the bias' first-order Gauss-Markov part [u], correlation_time: of that part [s];
    random_walk: of the bias (rate random walk) [u / sqrt(s)]; scale: error of the scale factor [1]; limit: readings
    are within +-limit [u].
    """

    noise_density: float
    bias: float
    instability: float
    correlation_time: float
    random_walk: float
    scale: float
    limit: float


class InertialError:
    """The errors of several axes, each with a bias of its own."""

    def __init__(self, settings: InertialErrorSettings, shape: tuple[int, ...], rng: np.random.Generator) -> None:
        """Power up: draw the biases of axes arranged in a shape."""
        self._settings = settings
        self._walking = settings.bias * rng.standard_normal(shape)
        self._markov = settings.instability * rng.standard_normal(shape)

    @property
    def bias(self) -> FloatArray:
        """The biases at present [u]."""
        return np.asarray(self._walking + self._markov)

    def apply(self, truth: FloatArray, dt: float, rng: np.random.Generator) -> FloatArray:
        """Return readings of the truth's mean over the last dt [s]; both have the shape of the axes."""
        s = self._settings
        kept = math.exp(-dt / s.correlation_time)
        self._markov = kept * self._markov + s.instability * math.sqrt(1 - kept**2) * rng.standard_normal(truth.shape)
        self._walking = self._walking + s.random_walk * math.sqrt(dt) * rng.standard_normal(truth.shape)
        white = s.noise_density / math.sqrt(dt) * rng.standard_normal(truth.shape)
        return np.clip((1 + s.scale) * truth + self.bias + white, -s.limit, s.limit)
