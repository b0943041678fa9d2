# SPDX-License-Identifier: BSD-3-Clause
"""Sizes of the causes, and which recordings they need."""
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.quay.things import Laser, Reference, Robot, Room

S: dict[str, dict[str, float]] = {
    "base.dac_zero_f": {"offset": 0.02}, "base.dac_zero_s": {"offset": 0.015}, "base.dac_quantisation": {"step": 0.05},
    "base.steering_law": {"flip": 0}, "base.delay": {"delay": 0.12}, "base.sign": {"factor_v": 0},
    "base.dead_zone_v": {"width": 0.04}, "base.dead_zone_w": {"width": 0.05}, "base.backlash": {"play": 0.1},
    "base.cross_v_to_w": {"share": 0.02}, "base.gain_v": {"gain": 0.06}, "base.gain_w": {"gain": 0.05},
    "base.left_right_gain": {"asymmetry": 0.05}, "base.veer": {"curvature": 0.05}, "base.reverse_gain": {"gain": 0.15},
    "base.curvature_v": {"curvature": 0.15}, "base.curvature_w": {"curvature": 0.12},
    "base.saturation": {"inverse_v": 1.5}, "base.battery_sag": {"sag": 0.0009}, "base.lag_v": {"tau": 0.25},
    "base.lag_w": {"tau": 0.15}, "base.accel_limit": {"slowness_v": 2.0, "slowness_w": 1.0},
    "base.payload": {"droop": 0.07, "tau": 0.2}, "base.process_noise": {"growth": 1.5}, "base.understeer": {"k": 0.3},
    "base.caster_reversal": {"kick": 0.2, "length": 0.3}, "base.lateral_slip": {"c": 0.05},
    "base.slope": {"climb_x": 0.02, "climb_y": 0.02},
    "base.cross_w_to_v": {"lever": 0.04},
    "base.marker_x": {"x": 0.05},
    "base.marker_y": {"y": 0.05}, "base.marker_yaw": {"yaw": 0.03}, "base.clock_scale": {"scale": 0.003},
    "laser.mount_x": {"x": 0.03}, "laser.mount_y": {"y": 0.03}, "laser.mount_yaw": {"yaw": 0.02},
    "laser.tilt": {"pitch": 0.06, "roll": 0.06}, "laser.sweep": {"stretch": 0.5}, "laser.latency": {"delay": 0.06},
    "laser.clock_skew": {"skew": 0.0004}, "laser.offset": {"offset": 0.015}, "laser.scale": {"scale": 0.006},
    "laser.quadratic": {"quadratic": 0.002}, "laser.warmup": {"amplitude": 0.03, "tau": 300},
    "laser.temperature": {"coefficient": 0.0015}, "laser.cyclic": {"amplitude": 0.005, "wavelength": 1.5, "phase": 1.5},
    "laser.incidence_bias": {"k": 0.006}, "laser.reflectance": {"bias": 0.015}, "laser.beam_bias": {"sd": 0.004},
    "laser.range_noise": {"share": 0.5}, "laser.incidence_noise": {"gain": 0.6}, "laser.common_mode": {"sd": 0.004},
    "laser.beam_correlation": {"rho": 0.4}, "laser.heavy_tails": {"inverse_nu": 0.3},
    "laser.mixed_pixels": {"probability": 0.5, "jump": 0.15}, "laser.dropout": {"probability": 0.05},
    "laser.saturation": {"inverse_far": 0.35}, "laser.crosstalk": {"probability": 0.3},
    "laser.quantisation": {"step": 0.02},
    "world.map_error": {"scale": 0.006}}
ALL = list(S)
VOLTS = ("base.dac_zero_f", "base.dac_zero_s", "base.dac_quantisation", "base.steering_law", "base.cross_v_to_w")
PLAIN = ("base.steering_law", "base.sign", "base.clock_scale", "base.marker_x", "base.marker_y", "base.marker_yaw",
         "laser.mount_x", "laser.mount_y", "laser.mount_yaw", "laser.tilt", "laser.sweep", "laser.offset",
         "laser.clock_skew", "laser.mixed_pixels", "laser.beam_correlation", "world.map_error", "laser.dropout")
SCATTER = ("laser.range_noise", "laser.incidence_noise", "laser.common_mode", "laser.beam_correlation",
           "laser.heavy_tails", "laser.mixed_pixels", "laser.dropout", "laser.saturation", "laser.crosstalk",
           "laser.quantisation", "unknown.spread")
ONE_SIGN = ("base.dac_quantisation", "base.delay", "base.dead_zone_v", "base.dead_zone_w", "base.backlash",
            "base.curvature_v", "base.curvature_w", "base.saturation", "base.battery_sag", "base.lag_v", "base.lag_w",
            "base.accel_limit", "base.payload", "base.process_noise", "base.understeer", "base.lateral_slip",
            "laser.cyclic", "laser.beam_bias", *SCATTER)


def draw(name: str, rng: np.random.Generator, scale: float, form: bool, robot: Robot, laser: Laser | None, room: Room,
         typical: bool = False) -> dict[str, Any]:
    """Parameters of a cause; scale: how much larger than usual; typical: its usual size, for a rival."""
    p: dict[str, Any] = {"form": form and name not in PLAIN}
    sign = 1 if typical or name in ONE_SIGN or rng.random() < 0.5 else -1
    f = scale * (1.0 if typical else float(np.exp(rng.uniform(-1.1, 0.6)))) * sign
    for key, value in S[name].items():
        p[key] = round(value * f, 5)
    slow = robot.vmax / 0.8
    if name in ("base.dead_zone_v", "base.dead_zone_w") and not robot.volts:
        p["width"] = round(abs(f) * 0.04 * (robot.vmax if name[-1] == "v" else robot.wmax), 5)
    elif name == "base.sign":
        k = 2 if typical else int(rng.integers(3))
        p |= [{"factor_v": -1}, {"factor_v": 1, "factor_w": -1}, {"factor_v": 1, "factor_w": 0.3}][k]
    elif name == "base.steering_law":
        p["flip"] = 1
    elif name == "base.veer":
        p["curvature"] = round(f * 0.04 / slow, 5)
    elif name == "base.curvature_v":
        p["curvature"] = round(min(f * 0.1, 0.5) / slow, 5)
    elif name == "base.saturation":
        p["inverse_v"] = round(1 / (robot.vmax * max(0.9 - 0.12 * f, 0.3)), 5)
        p["inverse_w"] = round(1 / (robot.wmax * max(0.9 - 0.12 * f, 0.3)), 5)
    elif name == "base.accel_limit":
        p["slowness_v"], p["slowness_w"] = round(f * 1.2 / slow, 5), round(f * 0.6, 5)
    elif name == "base.understeer":
        p["k"] = round(f * 0.25 / slow**2, 5)
    elif name == "base.slope":
        a = float(rng.uniform(-3, 3))
        p["climb_x"], p["climb_y"] = round(f * 0.03 * slow * np.cos(a), 5), round(f * 0.03 * slow * np.sin(a), 5)
    elif name == "base.caster_reversal":
        p["length"] = round(float(rng.uniform(0.15, 0.4)) * max(slow, 0.5), 3)
    elif name == "base.lateral_slip":
        p["c"] = min(p["c"], 0.45)
    elif name == "laser.cyclic":
        p["wavelength"], p["phase"] = round(float(rng.uniform(0.6, 3)), 3), round(float(rng.uniform(-3, 3)), 3)
    elif name == "laser.warmup":
        p["tau"] = round(float(rng.uniform(100, 500)), 1)
    elif name == "laser.tilt":
        p["roll"] = round(float(rng.uniform(-1, 1)) * p["roll"], 5)
    elif name == "laser.beam_correlation":
        p["rho"] = min(p["rho"], 0.9)
    elif name == "laser.heavy_tails":
        p["inverse_nu"] = min(p["inverse_nu"], 0.42)
    elif name == "laser.common_mode":
        p["rho"] = round(float(rng.uniform(0.3, 0.85)), 2)
    elif name == "laser.mixed_pixels":
        p["probability"], p["jump"] = min(p["probability"], 0.95), 0.15
    elif name == "laser.dropout":
        key = str(rng.choice(["probability", "per_metre", "oblique", "dark"]))
        p = {"form": False, "of": key, key: round(min(0.06 * f, 0.4) * (0.5 if key == "per_metre" else 1), 4)}
    elif name == "laser.saturation":
        far = min(laser.rmax if laser else 4.0, room.free[1] + 0.75)
        p["inverse_far"], p["lost"] = round(1 / (far * max(0.75 - 0.1 * f, 0.3)), 5), int(rng.random() < 0.5)
    elif name == "laser.crosstalk":
        p |= {"probability": min(0.25 * f, 0.8), "width": round(float(rng.uniform(0.2, 0.5)), 3),
              "drift": round(float(rng.uniform(-1, 1)), 3), "reach": 4.0}
    elif name == "laser.beam_bias" and laser:
        if rng.random() < 0.5:
            p["each"] = rng.standard_normal(laser.n) * p["sd"]
        else:
            p["amplitude"], p["phase"] = p.pop("sd"), round(float(rng.uniform(-3, 3)), 3)
            k = laser.angle_min + np.arange(laser.n) * laser.inc
            p["each"] = p["amplitude"] * np.sin((2 if p["form"] else 1) * k + p["phase"])
    elif name == "world.map_error" and (typical or rng.random() < 0.5):
        p["sd"] = 0.012 * abs(f)
        p.pop("scale")
        p["moved"] = rng.standard_normal((len(room.walls), 2)) * p["sd"]
    return p


def told(name: str, p: dict[str, Any]) -> dict[str, float]:
    """Parameters that mean what effects.md says."""
    if p["form"] or name in ("base.dac_quantisation", "base.process_noise", "base.curvature_v", "base.curvature_w",
                             "base.understeer", "laser.beam_bias", "laser.incidence_bias", "base.backlash",
                             "base.clock_scale", "laser.clock_skew", "base.left_right_gain", "base.caster_reversal",
                             "laser.reflectance", "laser.common_mode", "laser.warmup", "laser.mixed_pixels",
                             "laser.crosstalk", "laser.tilt"):
        return {}
    return {k: float(v) for k, v in p.items() if k not in ("form", "each", "moved", "of", "lost", "swap", "sd")}


UNKNOWN = [("base.v", q) for q in ("x", "y", "heading", "time_since_rest", "humidity", "comes")] + \
          [("base.w", q) for q in ("x", "y", "heading", "abs_v", "time_since_rest", "humidity", "comes")] + \
          [("base.pose", q) for q in ("x", "heading", "time", "humidity")] + \
          [("laser.range", q) for q in ("direction", "hit_x", "hit_y", "abs_w", "humidity", "comes", "bearing")] + \
          [("laser.spread", q) for q in ("direction", "bearing", "abs_w", "humidity", "time", "hit_x")]


def draw_unknown(rng: np.random.Generator, scale: float, ref: Reference,
                 laser: Laser) -> tuple[str, str, str, dict[str, Any]]:
    """Channel, covariate, key of the effect, parameters."""
    channel, of = UNKNOWN[int(rng.integers(len(UNKNOWN)))]
    part = channel.split(".")[1]
    a, b = float(rng.uniform(1.5, 3.5)), float(rng.uniform(0, 6.3))
    f = scale * float(np.exp(rng.uniform(-0.9, 0.4))) * (1 if rng.random() < 0.5 else -1)
    wave = of in ("direction", "bearing", "heading")

    def shape(x: np.ndarray) -> np.ndarray:
        """A wave or a bump."""
        if of == "comes":
            return (np.sin(2 * np.pi * x * (4 + 2 * a) + b) > 0.75) * 1.0
        if wave:
            return np.sin(np.pi * x * round(a) + b)
        return np.sin(a * x + b) if b > 3 else np.tanh(4 * (x - 0.5)) * 0.7

    size = {"v": 0.1, "w": 0.1, "range": 0.012, "spread": 0.7}.get(part, 0.0)
    p: dict[str, Any] = {"of": "time" if of == "comes" else of, "shape": shape, "size": size * f, "form": False}
    if part == "pose":
        p["part"] = int(rng.integers(3))
        p["size"] = f * (0.06 if p["part"] < 2 else 0.04)
    if of == "comes" and part in "vw":
        p["size"] *= 2
    return channel, p["of"], "unknown." + part, p
