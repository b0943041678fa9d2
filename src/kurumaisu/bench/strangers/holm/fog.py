# SPDX-License-Identifier: BSD-3-Clause
"""What can be wrong with the laser and its map: usual forms, other forms, and how well a scatter shows."""
from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .core import Array, Effect, Maker
from .laser import FAR, Look

USUAL: dict[str, tuple[float, Maker]] = {}
OTHER: dict[str, tuple[float, Maker]] = {}
SCATTER = {"laser.range_noise", "laser.incidence_noise", "laser.common_mode", "laser.beam_correlation",
           "laser.heavy_tails",
           "laser.mixed_pixels", "laser.dropout", "laser.saturation", "laser.crosstalk", "laser.quantisation"}
SIGNED = {"mount_x", "mount_y", "mount_yaw", "offset", "scale", "quadratic", "incidence_bias", "reflectance",
          "temperature",
          "latency", "clock_skew", "warmup"}
Change = Callable[[Look, float], Array]

def _geometry(name: str, size: float, hook: str, parts: Callable[[float], dict[str, float]],
              parameters: Callable[[float], dict[str, float]]) -> None:
    USUAL[name] = (size, lambda x, _: Effect(name, hook, settings=parts(x), parameters=parameters(x), channel="laser"))

def _mean(name: str, size: float, change: Change, parameter: str = "", other: Change | None = None) -> None:
    def maker(how: Change, key: str) -> Maker:
        def make(x: float, _: np.random.Generator) -> Effect:
            def act(s: Look) -> None:
                s.mu = s.mu + how(s, x)
            return Effect(name, "mean", act, {}, {key: x} if key else {}, "laser")
        return make
    USUAL[name] = (size, maker(change, parameter))
    if other is not None:
        OTHER[name] = (size, maker(other, ""))

def _scatter(name: str, size: float, hook: str, act: Callable[[Look, float, np.random.Generator], None],
             parameter: str = "",
             other: Callable[[Look, float, np.random.Generator], None] | None = None) -> None:
    def maker(how: Callable[[Look, float, np.random.Generator], None], key: str) -> Maker:
        def make(x: float, _: np.random.Generator) -> Effect:
            settings = {"seed": 0.0, "size": x}
            return Effect("laser." + name, hook, lambda s: how(s, x, np.random.default_rng(int(settings["seed"]))),
                          settings,
                          {key: x} if key else {}, "laser")
        return make
    USUAL["laser." + name] = (size, maker(act, parameter))
    if other is not None:
        OTHER["laser." + name] = (size, maker(other, ""))

for _key, _size in (("x", 0.03), ("y", 0.03), ("yaw", 0.02)):
    _geometry("laser.mount_" + _key, _size, "mount", lambda x, k=_key: {"mount_" + k: x},  # type: ignore[misc]
              lambda x, k=_key: {k: x})  # type: ignore[misc]
_geometry("laser.tilt", 0.06, "tilt", lambda x: {"pitch": x, "roll": 0.4 * x}, lambda x: {})
_geometry("laser.sweep", 0.5, "sweep", lambda x: {"stretch": x}, lambda x: {"stretch": x})
_geometry("laser.latency", 0.06, "stamps", lambda x: {"delay": x}, lambda x: {"delay": x})
_geometry("laser.clock_skew", 0.0004, "stamps", lambda x: {"skew": x}, lambda x: {"skew": x})
_mean("laser.offset", 0.01, lambda s, x: x + 0 * s.r, "offset")
_mean("laser.scale", 0.006, lambda s, x: x * s.r, "scale", lambda s, x: 2 * x * (np.sqrt(1 + s.r) - 1) * s.r**0.5)
_mean("laser.quadratic", 0.002, lambda s, x: x * s.r**2, "quadratic", lambda s,
      x: 0.45 * x * np.maximum(s.r - 0.8, 0) ** 2.5)
_mean("laser.warmup", 0.015, lambda s, x: x * np.exp(-s.session / 250), "", lambda s,
      x: x / (1 + s.session / 120) ** 1.5)
_mean("laser.temperature", 0.0006, lambda s, x: x * (s.extra["temperature"] - 20), "",
      lambda s, x: 0.1 * x * np.sign(s.extra["temperature"] - 20) * (s.extra["temperature"] - 20) ** 2)
_mean("laser.cyclic", 0.005, lambda s, x: x * np.sin(2 * np.pi * s.r / 2.4 + 0.8), "",
      lambda s, x: x * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * s.r / 1.8 + 0.5)))
_mean("laser.incidence_bias", 0.006, lambda s, x: x * np.minimum(np.tan(s.incidence), 6), "",
      lambda s, x: 3 * x * (1 - s.cos) ** 2)
_mean("laser.reflectance", 0.02, lambda s, x: x * (1 - s.shine), "", lambda s, x: 0.4 * x * np.log(1 / s.shine))
_mean("laser.beam_bias", 0.004, lambda s, x: x * np.sin(s.bearing + 1), "",
      lambda s, x: x * np.clip(1.6 * np.sin(s.bearing + 1), -1, 1))
_geometry("world.map_error", 0.006, "room", lambda x: {"scale": x}, lambda x: {})
OTHER["world.map_error"] = (0.02, lambda x, g: Effect("world.map_error", "room", settings={
    "sd": x, "seed": float(g.integers(1 << 30))}, channel="laser"))

def _wider(s: Look, x: float, _: np.random.Generator) -> None:
    s.sd = s.sd * (1 + x)

def _wider_far(s: Look, x: float, _: np.random.Generator) -> None:
    s.sd = s.sd * np.sqrt(1 + x * s.r)

def _oblique(s: Look, x: float, _: np.random.Generator) -> None:
    s.sd = s.sd * (1 + x * np.minimum(np.tan(s.incidence), 6))

def _oblique_foot(s: Look, x: float, _: np.random.Generator) -> None:
    s.sd = np.hypot(s.sd, 0.004 * x * s.r * np.minimum(np.tan(s.incidence), 6))

def _shared(s: Look, x: float, g: np.random.Generator) -> None:
    s.common = g.normal(0, x, (s.mu.shape[0], 1))

def _chain(s: Look, x: float, g: np.random.Generator) -> None:
    e = g.standard_normal(s.mu.shape)
    for k in range(1, e.shape[1]):
        e[:, k] = x * e[:, k - 1] + np.sqrt(1 - x * x) * e[:, k]
    s.error = e

def _smear(s: Look, x: float, g: np.random.Generator) -> None:
    e = g.standard_normal(s.mu.shape)
    e[:, 1:-1] += x * (e[:, :-2] + e[:, 2:])
    s.error = e / np.sqrt(1 + 2 * x * x)

def _student(s: Look, x: float, g: np.random.Generator) -> None:
    s.error = g.standard_t(1 / x, s.mu.shape)

def _contaminated(s: Look, x: float, g: np.random.Generator) -> None:
    e = g.standard_normal(s.mu.shape)
    s.error = np.where(g.random(e.shape) < 0.35 * x, e * 5, e)

def edges(s: Look) -> tuple[Array, Array]:
    """Where a beam's neighbour ends elsewhere, and the longer of the two ranges."""
    ahead = np.concatenate([s.mu[:, 1:], s.mu[:, -1:]], axis=1)
    behind = np.concatenate([s.mu[:, :1], s.mu[:, :-1]], axis=1)
    with np.errstate(invalid="ignore"):
        back = np.maximum(ahead, behind)
        return np.asarray((back - s.mu > 0.1) & (back < FAR)), back

def _mixed(s: Look, x: float, g: np.random.Generator) -> None:
    hit, back = edges(s)
    hit = hit & (g.random(hit.shape) < x)
    with np.errstate(invalid="ignore"):
        s.read = np.where(hit, s.read + g.random(hit.shape) * np.where(hit, back - s.mu, 0.0), s.read)

def _lost(chance: Callable[[Look, float], Array]) -> Callable[[Look, float, np.random.Generator], None]:
    def act(s: Look, x: float, g: np.random.Generator) -> None:
        s.read = np.where(g.random(s.mu.shape) < np.clip(chance(s, x), 0, 0.95), np.nan, s.read)
    return act

def _cut(s: Look, x: float, _: np.random.Generator) -> None:
    s.read = np.where(s.read > x, np.inf, s.read)

def _clip(s: Look, x: float, _: np.random.Generator) -> None:
    s.read = np.where(np.isfinite(s.read), np.minimum(s.read, x), s.read)

def bursts(s: Look, x: float, g: np.random.Generator) -> Array:
    """Which readings another laser's light may spoil."""
    width, centre = 0.35, -1.2 + 0.4 * s.session + 2 * g.random()
    off = (s.bearing - centre + np.pi) % (2 * np.pi) - np.pi
    return np.asarray((np.abs(off) < width) & (g.random((s.mu.shape[0], 1)) < x))

def _crosstalk(s: Look, x: float, g: np.random.Generator) -> None:
    hit = bursts(s, x, np.random.default_rng(1)) if s.mu.shape[0] > 1 else bursts(s, x, g)
    s.read = np.where(hit, g.uniform(0.1, 4.5, hit.shape), s.read)

def _coarse(s: Look, x: float, _: np.random.Generator) -> None:
    with np.errstate(invalid="ignore"):
        s.read = np.round(s.read / x) * x

def _coarse_cut(s: Look, x: float, _: np.random.Generator) -> None:
    with np.errstate(invalid="ignore"):
        s.read = np.floor(s.read / x + 1e-9) * x

_scatter("range_noise", 0.5, "spread", _wider, "share", _wider_far)
_scatter("incidence_noise", 0.6, "spread", _oblique, "", _oblique_foot)
_scatter("common_mode", 0.006, "error", _shared, "sd")
_scatter("beam_correlation", 0.5, "error", _chain, "rho", _smear)
_scatter("heavy_tails", 0.3, "error", _student, "inverse_nu", _contaminated)
_scatter("mixed_pixels", 0.5, "reading", _mixed)
_scatter("dropout", 0.08, "last", _lost(lambda s, x: x + 0 * s.r), "probability",
         _lost(lambda s, x: x * s.r**1.5 / s.shine**0.5))
_scatter("saturation", 2.5, "last", _cut, "", _clip)
_scatter("crosstalk", 0.3, "reading", _crosstalk)
_scatter("quantisation", 0.02, "last", _coarse, "step", _coarse_cut)

def _curve(change: Callable[[Look], Array]) -> Effect:
    def act(s: Look) -> None:
        s.mu = s.mu + change(s)
    return Effect("rival", "mean", act, channel="laser")

def _waves(of: Callable[[Look], Array], lengths: list[float]) -> list[list[Effect]]:
    return [[_curve(lambda s, k=k, p=p: 0.005 * np.sin(2 * np.pi * of(s) / k + p) + 0 * s.r)  # type: ignore[misc]
             for p in (0.0, np.pi / 2)] for k in lengths]

FAMILIES: dict[str, list[list[Effect]]] = {
    "laser.cyclic": _waves(lambda s: s.r, [0.8, 1.2, 1.6, 2.0, 2.5, 3.2, 4.0]),
    "laser.beam_bias": _waves(lambda s: s.bearing, [2 * np.pi]),
    "laser.temperature": _waves(lambda s: s.session, [40, 80, 160, 400, 1000]),
    "laser.warmup": [[_curve(lambda s, k=k: 0.01 * np.exp(-s.session / k) + 0 * s.r)]  # type: ignore[misc]
                     for k in (30, 100, 250, 600, 1200)],
    "laser.tilt": [[Effect("rival", "tilt", channel="laser",
                           settings={"pitch": 0.05 * np.cos(k), "roll": 0.05 * np.sin(k)})]
                   for k in np.arange(6) * np.pi / 6],
}
