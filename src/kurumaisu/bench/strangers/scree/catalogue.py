# SPDX-License-Identifier: BSD-3-Clause
"""Which causes there are, how large they usually are, and which of their numbers mean what the catalogue says."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Cause, Rng
from kurumaisu.bench.strangers.scree.robots import Robot
from kurumaisu.bench.strangers.scree.unknowns import NATURES


@dataclass(frozen=True)
class Entry:
    """A cause: its usual size, whether it may be negative, the name of its size if the equation has it."""

    id: str
    typical: float
    signed: bool = True
    parameter: str = ""


BASE = (
    Entry("base.gain_v", 0.04, True, "gain"),
    Entry("base.gain_w", 0.04, True, "gain"),
    Entry("base.left_right_gain", 0.08),
    Entry("base.veer", 0.03, True, "curvature"),
    Entry("base.reverse_gain", 0.08, True, "gain"),
    Entry("base.curvature_v", 0.09, False),
    Entry("base.curvature_w", 0.10, False),
    Entry("base.saturation", 0.15, False),
    Entry("base.battery_sag", 0.0007, False, "sag"),
    Entry("base.lag_v", 0.12, False, "tau"),
    Entry("base.lag_w", 0.12, False, "tau"),
    Entry("base.accel_limit", 1.0, False, "slowness_v"),
    Entry("base.payload", 0.06, False, "droop"),
    Entry("base.understeer", 0.25, False, "k"),
    Entry("base.caster_reversal", 0.12),
    Entry("base.lateral_slip", 0.05, False, "c"),
    Entry("base.slope", 0.02, False),
    Entry("base.cross_w_to_v", 0.03),
    Entry("base.delay", 0.08, False, "delay"),
    Entry("base.dead_zone_v", 0.03, False),
    Entry("base.dead_zone_w", 0.05, False),
    Entry("base.backlash", 0.06, False),
    Entry("base.marker_x", 0.04, True, "x"),
    Entry("base.marker_y", 0.04, True, "y"),
    Entry("base.marker_yaw", 0.03, True, "yaw"),
    Entry("base.clock_scale", 0.0025, True),
)
VOLTS = (
    Entry("base.dac_zero_f", 0.03, True, "offset"),
    Entry("base.dac_zero_s", 0.03, True, "offset"),
    Entry("base.dac_quantisation", 0.05, False, "step"),
    Entry("base.cross_v_to_w", 0.03, True, "share"),
    Entry("base.steering_law", 1.0, False),
)
LASER = (
    Entry("laser.mount_x", 0.02, True, "x"),
    Entry("laser.mount_y", 0.02, True, "y"),
    Entry("laser.mount_yaw", 0.015, True, "yaw"),
    Entry("laser.tilt", 0.06, False, "pitch"),
    Entry("laser.sweep", 0.25, True, "stretch"),
    Entry("laser.latency", 0.025, False, "delay"),
    Entry("laser.clock_skew", 0.0002, True),
    Entry("laser.offset", 0.008, True, "offset"),
    Entry("laser.scale", 0.004, True, "scale"),
    Entry("laser.quadratic", 0.0012, True, "quadratic"),
    Entry("laser.warmup", 0.012, True, "amplitude"),
    Entry("laser.temperature", 0.0012, True, "coefficient"),
    Entry("laser.cyclic", 0.005, False, "amplitude"),
    Entry("laser.incidence_bias", 0.004, True, "k"),
    Entry("laser.reflectance", 0.015, True, "bias"),
    Entry("laser.beam_bias", 0.005, False, "amplitude"),
    Entry("laser.range_noise", 0.35, False, "share"),
    Entry("laser.incidence_noise", 0.5, False, "gain"),
    Entry("laser.common_mode", 0.004, False, "sd"),
    Entry("laser.beam_correlation", 0.4, False, "rho"),
    Entry("laser.heavy_tails", 0.3, False),
    Entry("laser.mixed_pixels", 0.5, False, "probability"),
    Entry("laser.dropout", 0.06, False, "probability"),
    Entry("laser.saturation", 0.28, False, "inverse_far"),
    Entry("laser.crosstalk", 0.3, False),
    Entry("laser.quantisation", 0.02, False, "step"),
    Entry("world.map_error", 0.01, False),
)
ALL = {e.id: e for e in BASE + VOLTS + LASER}
LASER_IDS = tuple(e.id for e in LASER)
SCATTER = (
    "laser.range_noise",
    "laser.incidence_noise",
    "laser.common_mode",
    "laser.beam_correlation",
    "laser.heavy_tails",
    "laser.mixed_pixels",
    "laser.dropout",
    "laser.saturation",
    "laser.crosstalk",
    "laser.quantisation",
)
OF_REFERENCE = ("base.marker_x", "base.marker_y", "base.marker_yaw", "base.clock_scale")


def of_laser(name: str) -> bool:
    """Whether a cause, known or not, shows in the readings."""
    return name in LASER_IDS or (name in NATURES and NATURES[name].channel.startswith("laser"))


def draw_cause(entry: Entry, other: bool, grow: float, rng: Rng) -> Cause:
    """A cause at about its usual size, times `grow`."""
    size = entry.typical * float(np.exp(rng.normal(0.1, 0.3)))
    size = 1.0 if entry.id == "base.steering_law" else size * grow
    if entry.id == "laser.quantisation":
        size = max(round(size, 3), 0.003)
    limit = {"laser.beam_correlation": 0.9, "laser.sweep": 0.95, "laser.tilt": 0.4}
    size = min(size, limit.get(entry.id, np.inf))
    if entry.signed and rng.random() < 0.5:
        size = -size
    a, b, c = rng.random(3).tolist()
    return Cause(entry.id, float(np.round(size, 6)), other, (a, b, c))


def draw_unknown(name: str, grow: float, rng: Rng) -> Cause:
    """Something that the catalogue does not have, by its name here."""
    return draw_cause(Entry(name, NATURES[name].typical), False, grow, rng)


def fit_to(cause: Cause, robot: Robot) -> Cause:
    """The same for a smaller robot: what is in m/s or rad/s goes with its speed."""
    v, w = robot.v_top / 0.7, robot.w_top / 0.9
    by = {
        "base.slope": v,
        "base.curvature_v": 1 / v,
        "base.curvature_w": 1 / w,
        "base.understeer": 1 / v**2,
        "base.accel_limit": 1 / v,
        "base.veer": w / v,
        "base.lateral_slip": 1 / w,
        "base.cross_w_to_v": v / w,
        "base.dead_zone_v": v if not robot.volts else 1.0,
        "base.dead_zone_w": w if not robot.volts else 0.7,
        "base.backlash": w,
        "base.caster_reversal": w,
    }.get(cause.id, 1.0)
    return replace(cause, size=float(np.round(cause.size * by, 6)))


def told(cause: Cause) -> dict[str, float]:
    """The parameters that mean the same in the catalogue."""
    name = "" if cause.other or cause.id not in ALL else ALL[cause.id].parameter
    return {name: cause.size} if name else {}
