# SPDX-License-Identifier: BSD-3-Clause
"""What may be hidden: variants of the catalogue's effects, and things that are in no catalogue."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .drives import Run
from .plant import EFFECTS, SIGNED, Effect, State, reversals, since
from .scanner import CAST, MEANS, SCATTER, Mean, Scans
from .values import STEP, Array, Cause, Rng

BASE = list(EFFECTS)
LASER = [*MEANS, *SCATTER, "world.map_error"]
NO_OTHER = {"base.backlash", "base.marker_x", "base.marker_y", "laser.beam_bias", "laser.beam_correlation"}
NO_OTHER |= {"laser.tilt", "laser.warmup", "laser.temperature", "world.map_error"}
NO_OTHER |= CAST - {"laser.latency", "laser.mount_yaw"}
TWINS = {"base.cross_w_to_v", "base.marker_y"}  # a marker to the left is a lever: only in `confounded`
FORMS = [k for k in [*BASE, *LASER] if k not in NO_OTHER]
PLAIN = [k for k in BASE if k not in TWINS]

# parameters that mean the same here: name, as a function of the size
SAME = {
    "base.dac_zero_f": "offset",
    "base.dac_quantisation": "step",
    "base.delay": "delay",
    "base.dead_zone_v": "width",
    "base.gain_v": "gain",
    "base.gain_w": "gain",
    "base.veer": "curvature",
    "base.reverse_gain": "gain",
    "base.curvature_v": "curvature",
    "base.curvature_w": "curvature",
    "base.battery_sag": "sag",
    "base.cross_w_to_v": "lever",
    "base.lag_v": "tau",
    "base.lag_w": "tau",
    "base.understeer": "k",
    "base.lateral_slip": "c",
    "base.marker_x": "x",
    "base.marker_y": "y",
    "laser.mount_x": "x",
    "laser.mount_y": "y",
    "laser.mount_yaw": "yaw",
    "laser.sweep": "stretch",
    "laser.offset": "offset",
    "laser.scale": "scale",
    "laser.quadratic": "quadratic",
    "laser.temperature": "coefficient",
    "laser.cyclic": "amplitude",
    "laser.range_noise": "share",
    "laser.beam_correlation": "rho",
}


def parameters(c: Cause) -> dict[str, float]:
    """Those of a plain cause that the catalogue means, too."""
    if c.other:
        return {}
    out = {SAME[c.id]: c.size} if c.id in SAME else {}
    if c.id == "base.payload":
        out = {"droop": c.size, "tau": c.size * c.more["tau_per"]}
    elif c.id == "base.saturation":
        out = {"inverse_w" if c.more["turn"] else "inverse_v": 1.0 / (c.more["top"] * (1.0 - c.size))}
    elif c.id == "base.accel_limit":
        out = {} if "w" in c.more else {"slowness_v": c.size}
        out |= {} if "v" in c.more else {"slowness_w": 0.5 * c.size}
    elif c.id == "laser.cyclic":
        out |= {"wavelength": c.more["wavelength"]}
    return {k: round(float(v), 6) for k, v in out.items()}


def variants(name: str, tops: tuple[float, float]) -> list[Cause]:
    """Plain signals that together stand for an effect, at typical sizes."""
    sizes = {k: a for k, (_, a) in EFFECTS.items()} | {k: a for k, (_, a) in MEANS.items()} | SCATTER
    size = sizes.get(name, 0.003)
    shapes: dict[str, list[dict[str, float]]] = {
        "base.payload": [{"tau_per": 2.0}, {"tau_per": 0.02}],
        "base.slope": [{"uphill": 0.0}, {"uphill": np.pi / 2}],
        "base.caster_reversal": [{"length": 0.15}, {"length": 0.4}],
        "base.accel_limit": [{"v": 1.0}, {"w": 1.0}],
        "base.saturation": [{"turn": 0.0, "top": tops[0]}, {"turn": 1.0, "top": tops[1]}],
        "laser.cyclic": [{"wavelength": 3.0, "phase": 0.0}, {"wavelength": 3.0, "phase": np.pi / 2}],
        "laser.warmup": [{"tau": 600.0}],
    }
    return [Cause(name, size, more=m) for m in shapes.get(name, [{}])]


def draw_cause(name: str, other: bool, tops: tuple[float, float], rng: Rng) -> Cause:
    """A cause of typical size and random shape."""
    c = variants(name, tops)[-1 if name == "base.saturation" and rng.random() < 0.5 else 0]
    c.other = other
    if rng.random() < 0.5 and name.split(".")[1] not in SIGNED:
        c.size = -c.size
    draw: dict[str, Any] = {
        "base.payload": {"tau_per": float(rng.uniform(1.0, 3.0))},
        "base.slope": {"uphill": float(rng.uniform(-np.pi, np.pi))},
        "base.caster_reversal": {"length": float(rng.uniform(0.15, 0.4))},
        "base.accel_limit": [{}, {"v": 1.0}, {"w": 1.0}][int(rng.integers(3))],
        "laser.cyclic": {"wavelength": float(rng.uniform(2.0, 4.0)), "phase": float(rng.uniform(-3, 3))},
        "laser.tilt": {"toward": float(rng.uniform(-np.pi, np.pi))},
        "laser.warmup": {"tau": float(rng.uniform(300.0, 900.0))},
        "laser.beam_bias": {"draw": float(rng.integers(10**6))},
        "world.map_error": {"draw": float(rng.integers(10**6)), "scaled": float(rng.integers(2))},
    }
    if name in draw:
        c.more = dict(draw[name])
    return c


def _warm(s: State, a: float, c: Cause) -> None:
    rest = (np.abs(s.run.v) < 1e-3) & (np.abs(s.run.w) < 1e-3)
    gone = np.minimum(since(rest, s.run.t), 60.0)
    s.v = s.v * (1.0 - a * np.exp(-gone / c.more["length"]))


def _grain(s: State, a: float, c: Cause) -> None:
    s.w = s.w + a * np.sin(2.0 * s.heading + c.more["phase"]) * (np.abs(s.v) > 1e-3)


def _carpet(s: State, a: float, c: Cause) -> None:
    s.v = s.v * (1.0 - a * (s.place[:, 0] > 0.3))


def _column(s: State, a: float, c: Cause) -> None:
    s.w = s.w + a * s.run.columns["tyre_pressure"] * s.v


def _wind(s: State, a: float, c: Cause) -> None:
    s.side = s.side + a * s.run.columns["wind"] * s.moving


def _events(s: State, gap: float, width: float, c: Cause) -> Array:
    rng = np.random.default_rng([int(c.more["draw"]), len(s.v)])
    out = np.zeros(len(s.v))
    for t in np.cumsum(rng.uniform(0.4 * gap, 1.6 * gap, 60)):
        out += np.abs(s.run.t - t) < 0.5 * width
    return np.minimum(out, 1.0)


def _packets(s: State, a: float, c: Cause) -> None:
    s.v = s.v * (1.0 - a * _events(s, 7.0, 0.5, c))


def _gusts(s: State, a: float, c: Cause) -> None:
    s.w = s.w + a * _events(s, 9.0, 1.5, c) * s.moving


def _flat(s: State, a: float, c: Cause) -> None:
    gone = STEP * np.cumsum(np.abs(s.v - s.w * 0.27))
    s.v = s.v * (1.0 - a * ((gone / 1.1) % 1.0 < 0.25))


def _slack(s: State, a: float, c: Cause) -> None:
    gone = since(reversals(s.v), s.run.t)
    s.v = s.v * (1.0 - a * np.exp(-gone / 1.5))


def _band(s: State, a: float, c: Cause) -> None:
    s.v = s.v * (1.0 - a * np.exp(-(((np.abs(s.v) - c.more["at"]) / 0.07) ** 2)))


def _scrub(s: State, a: float, c: Cause) -> None:
    s.v = s.v - a * np.maximum(s.v * s.w - 0.05, 0.0)


UNKNOWN: dict[str, tuple[Effect, float, str, list[str]]] = {
    "warm": (_warm, 0.1, "v", ["since_rest"]),
    "grain": (_grain, 0.03, "w", ["heading"]),
    "carpet": (_carpet, 0.05, "v", ["x"]),
    "tyre": (_column, 0.05, "w", ["tyre_pressure"]),
    "wind": (_wind, 0.02, "lateral", ["wind"]),
    "packets": (_packets, 0.5, "v", ["time"]),
    "gusts": (_gusts, 0.05, "w", ["time"]),
    "flat": (_flat, 0.1, "v", ["distance"]),
    "slack": (_slack, 0.1, "v", ["since_reversal"]),
    "band": (_band, 0.1, "v", ["v", "abs_v", "v_f"]),
    "scrub": (_scrub, 0.2, "v", ["v_times_w"]),
}


def _compass(p: Array, a: float, c: Cause) -> Array:
    return np.asarray(p + np.column_stack([0 * p[:, 0], 0 * p[:, 0], a * np.sin(p[:, 2] + c.more["phase"])]))


def _lens(p: Array, a: float, c: Cause) -> Array:
    return np.asarray(p + np.column_stack([a * np.sin(2.0 * p[:, 0]), 0 * p[:, 0], 0 * p[:, 0]]))


REFERENCE: dict[str, tuple[Callable[[Array, float, Cause], Array], float, str, list[str]]] = {
    "compass": (_compass, 0.03, "reference", ["heading"]),
    "lens": (_lens, 0.02, "reference", ["x"]),
}


def _of(s: Scans, name: str) -> Array:
    return np.asarray(s.extra[name][:, None] + 0 * s.r)


def _glare(s: Scans, a: float, c: Cause) -> Array:
    return np.asarray(a * (np.abs(s.bearing - c.more["at"]) < 0.4) + 0 * s.r)


READ: dict[str, tuple[Mean, float, str, list[str]]] = {
    "vibration": (lambda s, a, c: a * np.abs(_of(s, "v")), 0.01, "range", ["v"]),
    "sun": (lambda s, a, c: a * np.maximum(np.cos(s.angle - c.more["phase"]), 0.0) ** 2, 0.005, "range", ["direction"]),
    "half": (lambda s, a, c: a * (s.pose[..., 0] > 0.0), 0.005, "range", ["x"]),
    "moist": (lambda s, a, c: a * _of(s, "humidity"), 0.005, "range", ["humidity"]),
    "shake": (lambda s, a, c: a * np.abs(_of(s, "w")), 0.2, "scatter", ["w"]),
    "glare": (
        lambda s, a, c: a * (np.abs(s.bearing - c.more["at"]) < 0.4) + 0 * s.r,
        0.2,
        "scatter",
        ["bearing", "beam"],
    ),
    "dust": (lambda s, a, c: a * (np.sin(_of(s, "time") / 6.0) > 0.4), 0.2, "scatter", ["time", "scan"]),
}


def draw_unknown(name: str, rng: Rng) -> Cause:
    """Something that is in no catalogue, of typical size."""
    size = {**UNKNOWN, **REFERENCE, **READ}[name][1]
    more = {"phase": float(rng.uniform(-3, 3)), "length": float(rng.uniform(1.0, 3.0))}
    more |= {"draw": float(rng.integers(10**6)), "at": float(rng.uniform(0.3, 0.5))}
    return Cause(name, size, more=more)


def tops(runs: list[Run]) -> tuple[float, float]:
    """The largest rates asked for."""
    return max(float(np.abs(r.v).max()) for r in runs), max(float(np.abs(r.w).max()) for r in runs)
