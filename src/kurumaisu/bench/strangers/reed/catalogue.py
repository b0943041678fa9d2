# SPDX-License-Identifier: BSD-3-Clause
"""How an effect is drawn, and what its parameters are called."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.reed.base import BASE, cap
from kurumaisu.bench.strangers.reed.core import Effect, Use
from kurumaisu.bench.strangers.reed.lasers import LASER

CATALOGUE: dict[str, Effect] = {**BASE, **LASER}
BOTH_WAYS = (
    "dac_zero_f",
    "dac_zero_s",
    "cross_v_to_w",
    "gain_v",
    "gain_w",
    "left_right_gain",
    "veer",
    "reverse_gain",
    "caster_reversal",
    "cross_w_to_v",
    "marker_x",
    "marker_y",
    "marker_yaw",
    "clock_scale",
    "mount_x",
    "mount_y",
    "mount_yaw",
    "tilt",
    "sweep",
    "clock_skew",
    "offset",
    "scale",
    "quadratic",
    "warmup",
    "temperature",
    "incidence_bias",
    "reflectance",
)


def draw(rng: np.random.Generator, name: str, other: bool = False) -> Use:
    """An effect with all that it needs beside its size."""
    aux = {
        "period": rng.uniform(5, 12),
        "phase": rng.uniform(0, 2 * np.pi),
        "odd": bool(rng.random() < 0.5),
        "length": rng.uniform(0.2, 0.5),
        "seed": int(rng.integers(1 << 30)),
        "tau": rng.uniform(100, 400),
        "wavelength": rng.uniform(0.9, 2.4),
        "rho": rng.uniform(0.6, 0.9),
    }
    effect = CATALOGUE[name]
    way = float(rng.choice([-1, 1])) if name.split(".")[1] in BOTH_WAYS else 1.0
    return Use(effect, way * effect.size, other and effect.second is not None, aux)


def parameters(u: Use) -> dict[str, float]:
    """Its parameters in the words of effects.md, where they mean the same."""
    if u.other and u.id != "world.map_error":
        return {}
    given: dict[str, dict[str, float]] = {
        "base.slope": {"climb_x": u.size * np.cos(u.aux["phase"]), "climb_y": u.size * np.sin(u.aux["phase"])},
        "base.saturation": {"inverse_v": 1 / max(cap(u, "v"), 0.01), "inverse_w": 1 / max(cap(u, "w"), 0.01)},
        "base.accel_limit": {"slowness_v": u.size, "slowness_w": u.size / 2},
        "base.payload": {"droop": u.size, "tau": 2 * u.size},
        "laser.saturation": {"inverse_far": (1 + u.size) / 4},
        "laser.cyclic": {"amplitude": u.size, "wavelength": u.aux["wavelength"], "phase": u.aux["phase"]},
        "laser.common_mode": {"sd": u.size, "rho": u.aux["rho"]},
        "world.map_error": {"scale" if u.other else "sd": u.size},
    }
    named = {u.effect.name: u.size} if u.effect.name else {}
    return {key: float(value) for key, value in given.get(u.id, named).items()}
