# SPDX-License-Identifier: BSD-3-Clause
"""Covariates of a session, and drives that cannot tell one effect from another."""

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu.bench.strangers.delta.core import Array

Columns = dict[str, Callable[[Array], Array]]

CONFOUNDED = [
    ("base.gain_v", {"base.curvature_v": 0.02}, "one_speed"),
    ("base.curvature_v", {"base.gain_v": 0.02, "base.dead_zone_v": 0.01}, "one_speed"),
    ("base.gain_w", {"base.curvature_w": 0.02}, "one_turn"),
    ("base.curvature_w", {"base.gain_w": 0.02, "base.dead_zone_w": 0.01}, "one_turn"),
    ("base.left_right_gain", {"base.gain_w": 0.02}, "left_only"),
    ("base.gain_w", {"base.left_right_gain": 0.02}, "left_only"),
    ("base.reverse_gain", {"base.gain_v": 0.02}, "reverse_only"),
    ("base.gain_v", {"base.reverse_gain": 0.02}, "reverse_only"),
    ("base.delay", {"base.lag_v": 0.02, "base.lag_w": 0.02}, "slow"),
    ("laser.warmup", {"laser.temperature": 0.0003}, "lab"),
    ("laser.temperature", {"laser.warmup": 0.003}, "lab"),
    ("laser.beam_bias", {"laser.mount_yaw": 0.01}, "lab"),
]


def columns(rng: np.random.Generator, names: Sequence[str]) -> Columns:
    """Covariates over the session: slow, each with its own course."""
    out: Columns = {}
    for name in names:
        low, high = {
            "battery": (26.0, 24.3),
            "temperature": (18.5, 24.0),
            "tyre_pressure": (2.6, 2.2),
            "humidity": (35.0, 60.0),
            "lamp": (100.0, 800.0),
        }[name]
        period, phase = rng.uniform(150, 500), rng.uniform(0, 6.3)

        def course(s: Array, a: float = low, b: float = high, p: float = period, f: float = phase) -> Array:
            """Value at times of the session."""
            return np.asarray(
                a + (b - a) * (0.5 + 0.35 * np.sin(6.283 * s / p + f) + 0.1 * np.sin(6.283 * s / 61 + 2 * f))
            )

        out[name] = course
    return out
