# SPDX-License-Identifier: BSD-3-Clause
"""The effects that may be hidden, with sizes, names of parameters, and where another law is at hand."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.delta.core import Array, Cause, Curve, Setup

WAVE = 2 * np.pi


@dataclass
class Entry:
    """One effect: name of its parameter, smallest and largest size, whether it has a sign, and another law."""

    parameter: str
    low: float
    high: float
    signed: bool
    other: bool


BASE = {
    "base.dac_zero_f": Entry("offset", 0.001, 0.3, True, True),
    "base.dac_zero_s": Entry("offset", 0.001, 0.3, True, True),
    "base.dac_quantisation": Entry("step", 0.004, 0.3, False, True),
    "base.steering_law": Entry("flip", 1.0, 1.0, False, False),
    "base.delay": Entry("delay", 0.01, 0.6, False, True),
    "base.dead_zone_v": Entry("width", 0.002, 0.2, False, True),
    "base.dead_zone_w": Entry("width", 0.002, 0.2, False, True),
    "base.backlash": Entry("play", 0.002, 0.3, False, True),
    "base.cross_v_to_w": Entry("share", 0.002, 0.3, True, True),
    "base.gain_v": Entry("gain", 0.003, 0.4, True, False),
    "base.gain_w": Entry("gain", 0.003, 0.4, True, False),
    "base.left_right_gain": Entry("asymmetry", 0.003, 0.4, True, True),
    "base.veer": Entry("curvature", 0.003, 0.5, True, True),
    "base.reverse_gain": Entry("gain", 0.005, 0.5, True, True),
    "base.curvature_v": Entry("curvature", 0.005, 0.5, True, True),
    "base.curvature_w": Entry("curvature", 0.005, 0.5, True, True),
    "base.saturation": Entry("inverse_v", 1.05, 6.0, False, True),
    "base.battery_sag": Entry("sag", 0.00003, 0.004, False, True),
    "base.lag_v": Entry("tau", 0.02, 1.0, False, True),
    "base.lag_w": Entry("tau", 0.02, 1.0, False, True),
    "base.accel_limit": Entry("slowness_v", 0.8, 12.0, False, True),
    "base.payload": Entry("droop", 0.003, 0.4, False, True),
    "base.process_noise": Entry("growth", 0.2, 6.0, False, True),
    "base.understeer": Entry("k", 0.02, 2.0, True, True),
    "base.caster_reversal": Entry("kick", 0.02, 1.0, True, True),
    "base.lateral_slip": Entry("c", 0.003, 0.4, False, True),
    "base.slope": Entry("climb", 0.001, 0.2, False, True),
    "base.cross_w_to_v": Entry("lever", 0.003, 0.3, True, True),
    "base.marker_x": Entry("x", 0.003, 0.5, True, False),
    "base.marker_y": Entry("y", 0.003, 0.5, True, False),
    "base.marker_yaw": Entry("yaw", 0.003, 0.5, True, False),
    "base.clock_scale": Entry("scale", 0.00005, 0.009, True, True),
}
VOLTAGE = ("base.dac_zero_f", "base.dac_zero_s", "base.dac_quantisation", "base.steering_law", "base.cross_v_to_w")
LASER = {
    "laser.mount_x": Entry("x", 0.002, 0.3, True, False),
    "laser.mount_y": Entry("y", 0.002, 0.3, True, False),
    "laser.mount_yaw": Entry("yaw", 0.001, 0.3, True, False),
    "laser.tilt": Entry("pitch", 0.01, 0.3, True, False),
    "laser.sweep": Entry("stretch", 0.05, 0.9, True, True),
    "laser.latency": Entry("delay", 0.003, 0.6, False, True),
    "laser.clock_skew": Entry("skew", 0.00002, 0.01, True, True),
    "laser.offset": Entry("offset", 0.0003, 0.1, True, False),
    "laser.scale": Entry("scale", 0.0002, 0.1, True, False),
    "laser.quadratic": Entry("quadratic", 0.0001, 0.05, True, False),
    "laser.warmup": Entry("amplitude", 0.0005, 0.1, True, True),
    "laser.temperature": Entry("coefficient", 0.00005, 0.01, True, True),
    "laser.cyclic": Entry("amplitude", 0.0003, 0.05, False, True),
    "laser.incidence_bias": Entry("k", 0.0001, 0.05, True, True),
    "laser.reflectance": Entry("bias", 0.0005, 0.1, True, True),
    "laser.beam_bias": Entry("sd", 0.0002, 0.02, False, True),
    "laser.range_noise": Entry("share", 0.04, 3.0, False, True),
    "laser.incidence_noise": Entry("gain", 0.03, 5.0, False, True),
    "laser.common_mode": Entry("sd", 0.0001, 0.02, False, True),
    "laser.beam_correlation": Entry("rho", 0.04, 0.9, False, True),
    "laser.heavy_tails": Entry("inverse_nu", 0.03, 0.4, False, True),
    "laser.mixed_pixels": Entry("probability", 0.02, 0.95, False, True),
    "laser.dropout": Entry("probability", 0.004, 0.3, False, True),
    "laser.saturation": Entry("far", 0.02, 1.5, False, True),
    "laser.crosstalk": Entry("probability", 0.01, 0.8, False, True),
    "laser.quantisation": Entry("step", 0.003, 0.012, False, False),
    "world.map_error": Entry("sd", 0.001, 0.1, False, True),
}
ALL = {**BASE, **LASER}


def possible(setup: Setup, other: bool) -> list[str]:
    """Effects that the recording can show."""
    names = [n for n in BASE if setup.volts or n not in VOLTAGE]
    if setup.scans:
        names += [n for n in LASER if n != "laser.temperature" or "temperature" in setup.columns]
    return [n for n in names if ALL[n].other or not other]


def draw(rng: np.random.Generator, name: str, other: bool) -> Cause:
    """A cause of a middle size."""
    entry = ALL[name]
    size = float(np.sqrt(entry.low * entry.high)) * (float(rng.choice([-1, 1])) if entry.signed else 1)
    lean = rng.uniform(0, WAVE)
    extra = {
        "base.payload": {"tau": float(rng.uniform(0.05, 0.2))},
        "base.caster_reversal": {"length": float(rng.uniform(0.15, 0.4))},
        "base.slope": {"direction": float(rng.uniform(-np.pi, np.pi))},
        "laser.tilt": {"pitch": float(np.cos(lean)), "roll": float(np.sin(lean))},
        "laser.warmup": {"tau": float(rng.uniform(300, 1200))},
        "laser.cyclic": {"wavelength": float(rng.uniform(0.5, 3.0)), "phase": float(rng.uniform(-3, 3))},
        "laser.common_mode": {"rho": float(rng.uniform(0, 0.9))},
        "laser.saturation": {"near": float(rng.uniform(0, 1.5))},
        "laser.crosstalk": {"drift": float(rng.uniform(0.1, 0.9)), "width": float(rng.uniform(0.1, 0.5))},
        "world.map_error": {"scaled": float(rng.random() < 0.5)},
    }.get(name, {})
    return Cause(name, size, other, extra)


def parameters(c: Cause) -> dict[str, float]:
    """Parameters by the names of effects.md; none where the law is another."""
    if c.other or c.curve:
        return {}
    s, e = c.size, c.extra
    special: dict[str, Callable[[], dict[str, float]]] = {
        "base.slope": lambda: {"climb_x": s * np.cos(e["direction"]), "climb_y": s * np.sin(e["direction"])},
        "base.accel_limit": lambda: {"slowness_v": s, "slowness_w": s / 2},
        "base.saturation": lambda: {"inverse_v": s, "inverse_w": 0.6 * s},
        "laser.tilt": lambda: {"pitch": s * e["pitch"], "roll": s * e["roll"]},
        "laser.saturation": lambda: {"near": e["near"] * s, "inverse_far": 1 / (4.0 - s)},
        "world.map_error": lambda: {"scale": s} if e["scaled"] else {"sd": s},
        "base.process_noise": dict,
    }
    kept = {k: v for k, v in e.items() if k in ("tau", "length", "wavelength", "phase", "rho", "width", "drift")}
    own = special[c.id]() if c.id in special else {ALL[c.id].parameter: s, **kept}
    return {k: float(v) for k, v in own.items()}


def unknowns(setup: Setup) -> list[Curve]:
    """Things that no sentence describes, each with what it follows."""
    rng, room = setup.rng, setup.room
    x0, y0 = room.width * rng.uniform(0.35, 0.65), room.depth * rng.uniform(0.35, 0.65)
    d0, period, phase = rng.uniform(-np.pi, np.pi), rng.uniform(20, 50), rng.uniform(0, WAVE)
    turn = rng.uniform(0.9, 1.6)

    def hump(centre: float, width: float, q: Array) -> Array:
        """A place of some width."""
        return np.asarray(np.exp(-(((q - centre) / width) ** 2)))

    def angle(q: Array) -> Array:
        """How far a direction is from a window, say."""
        return np.asarray(np.exp((np.cos(q - d0) - 1) / 0.15))

    def cold(q: Array) -> Array:
        """What fades within two seconds, from one second on."""
        return np.asarray(np.exp(-(((q - 1.8) / 1.0) ** 2)))

    def wave(q: Array) -> Array:
        """A slow wave."""
        return np.asarray(np.sin(WAVE * q / period + phase))

    names = list(setup.columns)
    out = [
        Curve("share_v", "x", lambda q: hump(x0, 0.5, q), ["x"]),
        Curve("share_v", "y", lambda q: hump(y0, 0.5, q), ["y"]),
        Curve("w", "y", lambda q: hump(y0, 0.4, q), ["y"]),
        Curve("path", "x", lambda q: np.sin(WAVE * (q - x0) / 2.2), ["x"]),
        Curve("path", "heading", lambda q: np.sin(4 * (q - d0)), ["heading"]),
        Curve("w", "time", wave, ["time"]),
        Curve("share_v", "time", wave, ["time"]),
        Curve("v", "time_since_rest", cold, ["time_since_rest", "distance_since_rest"]),
        Curve("share_w", "time_since_rest", cold, ["time_since_rest", "distance_since_rest"]),
        Curve("share_v", "distance", lambda q: np.cos(WAVE * q / turn + phase), ["distance"]),
        Curve("path", "distance", lambda q: np.cos(WAVE * q / turn + phase), ["distance"]),
        Curve("w", "acceleration", lambda q: np.tanh(q / 0.3), ["acceleration"]),
        Curve("share_v", "yaw_acceleration", lambda q: np.tanh((q / 0.5) ** 2), ["yaw_acceleration"]),
        Curve(
            "share_v",
            "distance_since_reversal",
            lambda q: np.exp(-q / 0.5),
            ["distance_since_reversal", "time_since_reversal"],
        ),
        Curve("reference.x", "x", lambda q: np.sin(WAVE * (q - x0) / 2.5), ["x"]),
        Curve("reference.y", "x", lambda q: np.sin(WAVE * (q - x0) / 3.0), ["x"]),
        Curve("reference.heading", "heading", lambda q: np.sin(2 * (q - d0)), ["heading"]),
        Curve("reference.heading", "y", lambda q: hump(y0, 0.7, q), ["y"]),
    ]
    for n in names:
        middle = float(np.median(setup.columns[n](np.linspace(0, setup.drives[-1].session, 200))))
        spread = float(np.std(setup.columns[n](np.linspace(0, setup.drives[-1].session, 200)))) + 1e-6
        out += [
            Curve(channel, n, lambda q, a=middle, b=spread: np.tanh(2 * (q - a) / b), [n])  # type: ignore[misc]
            for channel in ("share_v", "path", *(("range", "range_noise") if setup.scans else ()))
            if n != "temperature" or channel != "range"
        ]
    if setup.scans:
        lit = [("range", ["direction"], angle), ("range_noise", ["direction"], angle)]
        lit += [("range", ["hit_x"], lambda q: hump(x0, 0.4, q)), ("range", ["hit_y"], lambda q: hump(y0, 0.4, q))]
        lit += [("range", ["abs_w", "w"], lambda q: np.tanh(np.abs(q) / 0.3)), ("range", ["abs_v", "v"], lambda q: q)]
        lit += [(c, ["abs_v", "v"], lambda q: np.tanh(q / 0.3)) for c in ("range_noise",)]
        lit += [("range_noise", ["abs_w", "w"], lambda q: np.tanh(np.abs(q) / 0.3)), ("range_noise", ["time"], wave)]
        out += [Curve(channel, names[0], shape, names) for channel, names, shape in lit]
    return out
