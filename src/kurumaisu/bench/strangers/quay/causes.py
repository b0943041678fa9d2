# SPDX-License-Identifier: BSD-3-Clause
"""Which causes there are, and how large they are drawn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kurumaisu.bench.strangers.quay.base import Cause
from kurumaisu.bench.strangers.quay.things import Array, Rng, Robot, Scene

# Name, marks, usual sizes. Marks: u needs voltages, = has one form only, + sizes have one sign, ~ likewise and shows in
# the scatter of readings, ? has parameters that are not told, . none.
_TABLE = """
base.dac_zero_f u offset 0.02; base.dac_zero_s u offset 0.015; base.dac_quantisation u+? step 0.05;
base.steering_law u= flip 0; base.delay + delay 0.12; base.sign = factor_v 0; base.dead_zone_v + width 0.04;
base.dead_zone_w + width 0.05; base.backlash +? play 0.1; base.cross_v_to_w u share 0.02; base.gain_v . gain 0.06;
base.gain_w . gain 0.05; base.left_right_gain ? asymmetry 0.05; base.veer . curvature 0.05;
base.reverse_gain . gain 0.15; base.curvature_v +? curvature 0.15; base.curvature_w +? curvature 0.12;
base.saturation + inverse_v 1.5; base.battery_sag + sag 0.0009; base.lag_v + tau 0.25; base.lag_w + tau 0.15;
base.accel_limit + slowness_v 2.0 slowness_w 1.0; base.payload + droop 0.07 tau 0.2; base.process_noise +? growth 1.5;
base.understeer +? k 0.3; base.caster_reversal ? kick 0.2 length 0.3; base.lateral_slip + c 0.05;
base.slope . climb_x 0.02 climb_y 0.02; base.cross_w_to_v . lever 0.04; base.marker_x = x 0.05; base.marker_y = y 0.05;
base.marker_yaw = yaw 0.03; base.clock_scale =? scale 0.003; laser.mount_x = x 0.03; laser.mount_y = y 0.03;
laser.mount_yaw = yaw 0.02; laser.tilt =? pitch 0.06 roll 0.06; laser.sweep = stretch 0.5; laser.latency . delay 0.06;
laser.clock_skew =? skew 0.0004; laser.offset = offset 0.015; laser.scale . scale 0.006;
laser.quadratic . quadratic 0.002; laser.warmup ? amplitude 0.03 tau 300; laser.temperature . coefficient 0.0015;
laser.cyclic + amplitude 0.005 wavelength 1.5 phase 1.5; laser.incidence_bias ? k 0.006;
laser.reflectance ? bias 0.015; laser.beam_bias +? sd 0.004; laser.range_noise ~ share 0.5;
laser.incidence_noise ~ gain 0.6; laser.common_mode ~? sd 0.004; laser.beam_correlation =~ rho 0.4;
laser.heavy_tails ~ inverse_nu 0.3; laser.mixed_pixels =~? probability 0.5 jump 0.15;
laser.dropout =~ probability 0.05; laser.saturation ~ inverse_far 0.35; laser.crosstalk ~? probability 0.3;
laser.quantisation ~ step 0.02; world.map_error = scale 0.006
"""
_WORDS = [entry.split() for entry in _TABLE.split(";")]
SIZES = {name: dict(zip(sizes[::2], map(float, sizes[1::2]), strict=True)) for name, _marks, *sizes in _WORDS}
ALL = list(SIZES)


def _marked(mark: str) -> set[str]:
    return {name for name, marks, *_ in _WORDS if mark in marks}


VOLTS, PLAIN = _marked("u"), _marked("=")
SCATTER = _marked("~") | {"unknown.spread"}
ONE_SIGN, UNTOLD = _marked("+") | _marked("~"), _marked("?")


class Draw(NamedTuple):
    """What a size depends on: a factor, the scene, and the dice."""

    f: float
    rng: Rng
    scene: Scene

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        return self.scene.robot

    @property
    def slow(self) -> float:
        """Return the robot's speed as a share of the wheelchair's."""
        return self.robot.vmax / 0.8


def _dead(top: float, c: Draw) -> Cause:
    return {} if c.robot.volts else {"width": round(abs(c.f) * 0.04 * top, 5)}


def _sign(p: Cause, c: Draw) -> Cause:
    options: list[Cause] = [{"factor_v": -1}, {"factor_v": 1, "factor_w": -1}, {"factor_v": 1, "factor_w": 0.3}]
    return options[int(c.rng.integers(3))]


def _slope(p: Cause, c: Draw) -> Cause:
    a = float(c.rng.uniform(-3, 3))
    x, y = c.f * 0.03 * c.slow * np.cos(a), c.f * 0.03 * c.slow * np.sin(a)
    return {"climb_x": round(x, 5), "climb_y": round(y, 5)}


def _base_saturation(p: Cause, c: Draw) -> Cause:
    share = max(0.9 - 0.12 * c.f, 0.3)
    return {"inverse_v": round(1 / (c.robot.vmax * share), 5), "inverse_w": round(1 / (c.robot.wmax * share), 5)}


def _dropout(p: Cause, c: Draw) -> Cause:
    key = str(c.rng.choice(["probability", "per_metre", "oblique", "dark"]))
    share = round(min(0.06 * c.f, 0.4) * (0.5 if key == "per_metre" else 1), 4)
    return {"probability": None, "of": key} | {key: share}


def _laser_saturation(p: Cause, c: Draw) -> Cause:
    assert c.scene.laser
    far = min(c.scene.laser.rmax, c.scene.room.free[1] + 0.75)
    return {"inverse_far": round(1 / (far * max(0.75 - 0.1 * c.f, 0.3)), 5), "lost": int(c.rng.random() < 0.5)}


def _crosstalk(p: Cause, c: Draw) -> Cause:
    width, drift = round(float(c.rng.uniform(0.2, 0.5)), 3), round(float(c.rng.uniform(-1, 1)), 3)
    return {"probability": min(0.25 * c.f, 0.8), "width": width, "drift": drift, "reach": 4.0}


def _beam_bias(p: Cause, c: Draw) -> Cause:
    laser = c.scene.laser
    assert laser
    if c.rng.random() < 0.5:
        return {"each": c.rng.standard_normal(laser.n) * p["sd"]}
    phase = round(float(c.rng.uniform(-3, 3)), 3)
    return {"each": p["sd"] * np.sin((2 if p["form"] else 1) * laser.bearings + phase)}


def _map_error(p: Cause, c: Draw) -> Cause:
    if c.rng.random() >= 0.5:
        return {}
    return {"scale": None, "moved": c.rng.standard_normal((len(c.scene.room.walls), 2)) * (0.012 * abs(c.f))}


# What is not the usual size times a factor; None: there is no such parameter then.
FINISH: dict[str, Callable[[Cause, Draw], Cause]] = {
    "base.dead_zone_v": lambda p, c: _dead(c.robot.vmax, c),
    "base.dead_zone_w": lambda p, c: _dead(c.robot.wmax, c),
    "base.sign": _sign,
    "base.steering_law": lambda p, c: {"flip": 1},
    "base.veer": lambda p, c: {"curvature": round(c.f * 0.04 / c.slow, 5)},
    "base.curvature_v": lambda p, c: {"curvature": round(min(c.f * 0.1, 0.5) / c.slow, 5)},
    "base.saturation": _base_saturation,
    "base.accel_limit": lambda p, c: {"slowness_v": round(c.f * 1.2 / c.slow, 5), "slowness_w": round(c.f * 0.6, 5)},
    "base.understeer": lambda p, c: {"k": round(c.f * 0.25 / c.slow**2, 5)},
    "base.slope": _slope,
    "base.caster_reversal": lambda p, c: {"length": round(float(c.rng.uniform(0.15, 0.4)) * max(c.slow, 0.5), 3)},
    "base.lateral_slip": lambda p, c: {"c": min(p["c"], 0.45)},
    "laser.cyclic": lambda p, c: {
        "wavelength": round(float(c.rng.uniform(0.6, 3)), 3),
        "phase": round(float(c.rng.uniform(-3, 3)), 3),
    },
    "laser.warmup": lambda p, c: {"tau": round(float(c.rng.uniform(100, 500)), 1)},
    "laser.tilt": lambda p, c: {"roll": round(float(c.rng.uniform(-1, 1)) * p["roll"], 5)},
    "laser.beam_correlation": lambda p, c: {"rho": min(p["rho"], 0.9)},
    "laser.heavy_tails": lambda p, c: {"inverse_nu": min(p["inverse_nu"], 0.42)},
    "laser.common_mode": lambda p, c: {"rho": round(float(c.rng.uniform(0.3, 0.85)), 2)},
    "laser.mixed_pixels": lambda p, c: {"probability": min(p["probability"], 0.95), "jump": 0.15},
    "laser.dropout": _dropout,
    "laser.saturation": _laser_saturation,
    "laser.crosstalk": _crosstalk,
    "laser.beam_bias": _beam_bias,
    "world.map_error": _map_error,
}


def draw(name: str, rng: Rng, scale: float, form: bool, scene: Scene, typical: bool = False) -> Cause:
    """Draw parameters of a cause; scale: how much larger than usual; typical: its usual size, for a rival."""
    sign = 1 if typical or name in ONE_SIGN or rng.random() < 0.5 else -1
    f = scale * (1.0 if typical else float(np.exp(rng.uniform(-1.1, 0.6)))) * sign
    p: Cause = {"form": form and name not in PLAIN}
    p |= {key: round(value * f, 5) for key, value in SIZES[name].items()}
    if name in FINISH:
        p |= FINISH[name](p, Draw(f, rng, scene))
    return {key: value for key, value in p.items() if value is not None}


def told(name: str, p: Cause) -> dict[str, float]:
    """Return the parameters that mean what the catalogue says."""
    if p["form"] or name in UNTOLD:
        return {}
    return {k: float(v) for k, v in p.items() if k not in ("form", "each", "moved", "of", "lost")}


UNKNOWN = {
    "base.v": ("x", "y", "heading", "time_since_rest", "humidity", "comes"),
    "base.w": ("x", "y", "heading", "abs_v", "time_since_rest", "humidity", "comes"),
    "base.pose": ("x", "heading", "time", "humidity"),
    "laser.range": ("direction", "hit_x", "hit_y", "abs_w", "humidity", "comes", "bearing"),
    "laser.spread": ("direction", "bearing", "abs_w", "humidity", "time", "hit_x"),
}
PAIRS = [(channel, of) for channel, all_of in UNKNOWN.items() for of in all_of]


def draw_unknown(rng: Rng, scale: float) -> tuple[str, str, str, Cause]:
    """Draw something that is in no catalogue: channel, covariate, key of the effect, parameters."""
    channel, of = PAIRS[int(rng.integers(len(PAIRS)))]
    part = channel.split(".")[1]
    a, b = float(rng.uniform(1.5, 3.5)), float(rng.uniform(0, 6.3))
    f = scale * float(np.exp(rng.uniform(-0.9, 0.4))) * (1 if rng.random() < 0.5 else -1)

    def shape(x: Array) -> Array:
        if of == "comes":  # and goes
            return np.asarray((np.sin(2 * np.pi * x * (4 + 2 * a) + b) > 0.75) * 1.0)
        if of in ("direction", "bearing", "heading"):
            return np.asarray(np.sin(np.pi * x * round(a) + b))
        return np.asarray(np.sin(a * x + b) if b > 3 else np.tanh(4 * (x - 0.5)) * 0.7)

    size = {"v": 0.1, "w": 0.1, "range": 0.012, "spread": 0.7}.get(part, 0.0)
    p: dict[str, Any] = {"of": "time" if of == "comes" else of, "shape": shape, "size": size * f, "form": False}
    if part == "pose":
        p["part"] = int(rng.integers(3))
        p["size"] = f * (0.06 if p["part"] < 2 else 0.04)
    if of == "comes" and part in "vw":
        p["size"] *= 2
    return channel, p["of"], "unknown." + part, p
