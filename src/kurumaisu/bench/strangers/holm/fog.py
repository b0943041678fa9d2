# SPDX-License-Identifier: BSD-3-Clause
"""What can be wrong with the laser and its map: usual forms, other forms, and rivals of many shapes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu.bench.strangers.holm.core import OTHER, Act, Array, Effect, acts, by, changes, effect, sets
from kurumaisu.bench.strangers.holm.laser import FAR, Look

SCATTER_HOOKS = {"spread", "error", "reading", "last"}


def _foot(s: Look) -> Array:
    return np.minimum(np.tan(s.incidence), 6)


def _oblique_foot(s: Look, x: float) -> None:
    s.sd = np.hypot(s.sd, 0.004 * x * s.r * _foot(s))


def _shared(s: Look, x: float) -> None:
    s.common = s.rng.normal(0, x, (s.mu.shape[0], 1))


def _chain(s: Look, x: float) -> None:
    e = s.rng.standard_normal(s.mu.shape)
    for k in range(1, e.shape[1]):
        e[:, k] = x * e[:, k - 1] + np.sqrt(1 - x * x) * e[:, k]
    s.error = e


def _smear(s: Look, x: float) -> None:
    e = s.rng.standard_normal(s.mu.shape)
    e[:, 1:-1] += x * (e[:, :-2] + e[:, 2:])
    s.error = e / np.sqrt(1 + 2 * x * x)


def _student(s: Look, x: float) -> None:
    s.error = s.rng.standard_t(1 / x, s.mu.shape)


def _contaminated(s: Look, x: float) -> None:
    e = s.rng.standard_normal(s.mu.shape)
    s.error = np.where(s.rng.random(e.shape) < 0.35 * x, e * 5, e)


def _mixed(s: Look, x: float) -> None:
    ahead = np.concatenate([s.mu[:, 1:], s.mu[:, -1:]], axis=1)
    behind = np.concatenate([s.mu[:, :1], s.mu[:, :-1]], axis=1)
    with np.errstate(invalid="ignore"):
        back = np.maximum(ahead, behind)
        hit = (back - s.mu > 0.1) & (back < FAR) & (s.rng.random(back.shape) < x)
        s.read = np.where(hit, s.read + s.rng.random(hit.shape) * np.where(hit, back - s.mu, 0.0), s.read)


def _lost(chance: Callable[[Look, float], Array]) -> Act:
    def act(s: Look, x: float) -> None:
        s.read = np.where(s.rng.random(s.mu.shape) < np.clip(chance(s, x), 0, 0.95), np.nan, s.read)

    return act


def _cut(s: Look, x: float) -> None:
    s.read = np.where(s.read > x, np.inf, s.read)


def _clip(s: Look, x: float) -> None:
    s.read = np.where(np.isfinite(s.read), np.minimum(s.read, x), s.read)


def _crosstalk(s: Look, x: float) -> None:
    g = np.random.default_rng(1) if s.mu.shape[0] > 1 else s.rng
    off = (s.bearing - (-1.2 + 0.4 * s.session + 2 * g.random()) + np.pi) % (2 * np.pi) - np.pi
    hit = (np.abs(off) < 0.35) & (g.random((s.mu.shape[0], 1)) < x)
    s.read = np.where(hit, s.rng.uniform(0.1, 4.5, hit.shape), s.read)


def _coarse(s: Look, x: float) -> None:
    with np.errstate(invalid="ignore"):
        s.read = np.round(s.read / x) * x


def _coarse_cut(s: Look, x: float) -> None:
    with np.errstate(invalid="ignore"):
        s.read = np.floor(s.read / x + 1e-9) * x


def _warm(s: Look) -> Array:
    return s.extra["temperature"] - 20


sets("laser.mount_x", 0.03, "mount", lambda x: {"mount_x": x}, lambda x: {"x": x})
sets("laser.mount_y", 0.03, "mount", lambda x: {"mount_y": x}, lambda x: {"y": x})
sets("laser.mount_yaw", 0.02, "mount", lambda x: {"mount_yaw": x}, lambda x: {"yaw": x})
sets("laser.tilt", 0.06, "tilt", lambda x: {"pitch": x, "roll": 0.4 * x}, most=0.2)
sets("laser.sweep", 0.5, "sweep", lambda x: {"stretch": x}, lambda x: {"stretch": x}, most=0.95)
sets("laser.latency", 0.06, "stamps", lambda x: {"delay": x}, lambda x: {"delay": x}, most=0.3)
sets("laser.clock_skew", 0.0004, "stamps", lambda x: {"skew": x}, lambda x: {"skew": x})
changes("offset", 0.01, "mean mu+", "offset", lambda s, x: x + 0 * s.r)
changes(
    "scale", 0.006, "mean mu+", "scale", lambda s, x: x * s.r, lambda s, x: 2 * x * (np.sqrt(1 + s.r) - 1) * s.r**0.5
)
changes(
    "quadratic",
    0.002,
    "mean mu+",
    "quadratic",
    lambda s, x: x * s.r**2,
    lambda s, x: 0.45 * x * np.maximum(s.r - 0.8, 0) ** 2.5,
)
changes(
    "warmup",
    0.015,
    "mean mu+",
    "",
    lambda s, x: x * np.exp(-s.session / 250),
    lambda s, x: x / (1 + s.session / 120) ** 1.5,
)
changes(
    "temperature",
    0.0006,
    "mean mu+",
    "",
    lambda s, x: x * _warm(s),
    lambda s, x: 0.1 * x * np.sign(_warm(s)) * _warm(s) ** 2,
)
changes(
    "cyclic",
    0.005,
    "mean mu+",
    "",
    lambda s, x: x * np.sin(2 * np.pi * s.r / 2.4 + 0.8),
    lambda s, x: x * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * s.r / 1.8 + 0.5)),
)
changes("incidence_bias", 0.006, "mean mu+", "", lambda s, x: x * _foot(s), lambda s, x: 3 * x * (1 - s.cos) ** 2)
changes(
    "reflectance", 0.02, "mean mu+", "", lambda s, x: x * (1 - s.shine), lambda s, x: 0.4 * x * np.log(1 / s.shine), 0.1
)
changes(
    "beam_bias",
    0.004,
    "mean mu+",
    "",
    lambda s, x: x * np.sin(s.bearing + 1),
    lambda s, x: x * np.clip(1.6 * np.sin(s.bearing + 1), -1, 1),
)
changes("range_noise", 0.5, "spread sd*", "share", lambda s, x: 1 + x, lambda s, x: np.sqrt(1 + x * s.r))
acts("incidence_noise", 0.6, "spread", by("sd*", lambda s, x: 1 + x * _foot(s)), "", _oblique_foot)
acts("common_mode", 0.006, "error", _shared, "sd", most=0.04)
acts("beam_correlation", 0.5, "error", _chain, "rho", _smear, 0.85)
acts("heavy_tails", 0.3, "error", _student, "inverse_nu", _contaminated, 0.42)
acts("mixed_pixels", 0.5, "reading", _mixed, most=1.0)
acts(
    "dropout",
    0.08,
    "last",
    _lost(lambda s, x: x + 0 * s.r),
    "probability",
    _lost(lambda s, x: x * s.r**1.5 / s.shine**0.5),
    0.4,
)
acts("saturation", 2.5, "last", _cut, "", _clip)
acts("crosstalk", 0.3, "reading", _crosstalk, most=0.9)
acts("quantisation", 0.02, "last", _coarse, "step", _coarse_cut, 0.08)
sets("world.map_error", 0.006, "room", lambda x: {"scale": x})
OTHER["world.map_error"] = (
    0.02,
    lambda x, g: Effect("world.map_error", "room", settings={"sd": x, "seed": float(g.integers(1 << 30))}),
)


def _waves(of: Callable[[Look], Array], lengths: Sequence[float]) -> list[list[Effect]]:
    def wave(phase: float) -> Act:
        return by("mu+", lambda s, k: 0.005 * np.sin(2 * np.pi * of(s) / k + phase) + 0 * s.r)

    return [[effect("rival", "mean", wave(phase), k) for phase in (0.0, np.pi / 2)] for k in lengths]


_FADING = by("mu+", lambda s, k: 0.01 * np.exp(-s.session / k) + 0 * s.r)
FAMILIES: dict[str, list[list[Effect]]] = {
    "laser.cyclic": _waves(lambda s: s.r, [0.8, 1.2, 1.6, 2.0, 2.5, 3.2, 4.0]),
    "laser.beam_bias": _waves(lambda s: s.bearing, [2 * np.pi]),
    "laser.temperature": _waves(lambda s: s.session, [40, 80, 160, 400, 1000]),
    "laser.warmup": [[effect("rival", "mean", _FADING, k)] for k in (30, 100, 250, 600, 1200)],
    "laser.tilt": [
        [Effect("rival", "tilt", settings={"pitch": 0.05 * np.cos(k), "roll": 0.05 * np.sin(k)})]
        for k in np.arange(6) * np.pi / 6
    ],
}
