# SPDX-License-Identifier: BSD-3-Clause
"""What can be hidden, and how large it is drawn."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.fell.plant import Cause, Rng

# name kind size ...; kinds: s signed size, p positive size, u uniform, c a choice, r a seed; ! is told in truth.json
_TABLE = """
base.dac_zero_f: offset! s .01; base.dac_zero_s: offset! s .01; base.dac_quantisation: step! p .025;
base.steering_law: flip! c 1; base.delay: delay! p .05; base.sign: factor_v! c 1 factor_w! c -1;
base.dead_zone_v: width! p .03; base.dead_zone_w: width! p .03; base.backlash: play p .05;
base.cross_v_to_w: share! s .02; base.gain_v: gain! s .04; base.gain_w: gain! s .04;
base.left_right_gain: asymmetry s .06; base.veer: curvature! s .03; base.reverse_gain: gain! s .08;
base.curvature_v: curvature! p .08; base.curvature_w: curvature! p .06;
base.saturation: inverse_v! p 1.3 inverse_w! p 1.1; base.battery_sag: sag! p .0006; base.lag_v: tau! p .15;
base.lag_w: tau! p .12; base.accel_limit: slowness_v! p 1.2 slowness_w! p .7; base.payload: droop! p .05 tau! p .1;
base.process_noise: a p 2; base.understeer: k! p .15; base.caster_reversal: kick! s .15 length! u .15 .4;
base.lateral_slip: c! p .03; base.slope: climb_x! s .015 climb_y! s .015; base.cross_w_to_v: lever s .03;
base.marker_x: x! s .03; base.marker_y: y! s .03; base.marker_yaw: yaw! s .02; base.clock_scale: scale! s .001;
laser.mount_x: x! s .02; laser.mount_y: y! s .02; laser.mount_yaw: yaw! s .01; laser.tilt: pitch p .06 roll s .03;
laser.sweep: stretch! s .3; laser.latency: delay! p .03; laser.clock_skew: skew! s .0005; laser.offset: offset! s .01;
laser.scale: scale! s .005; laser.quadratic: quadratic! s .002; laser.warmup: amplitude! s .02 tau! u 40 300;
laser.temperature: coefficient! s .0015; laser.cyclic: amplitude! p .005 wavelength! u 1 3 phase u -3 3;
laser.incidence_bias: k s .006; laser.reflectance: bias s .02; laser.beam_bias: sd p .003 seed r;
laser.range_noise: share! p .4; laser.incidence_noise: gain p .5; laser.common_mode: sd! p .003 rho u .6 .9;
laser.beam_correlation: rho! c .3 .45; laser.heavy_tails: outliers! p .03 reach u .08 .2;
laser.mixed_pixels: probability c .5 .7; laser.dropout: probability p .05; laser.saturation: inverse_far! p .3;
laser.crosstalk: probability! u .2 .4 width! p .4 drift! u .2 .8 reach u 2 4; laser.quantisation: step! p .015;
world.map_error: sd! p .015 seed r
"""
TABLE: dict[str, str] = dict(entry.strip().split(": ") for entry in _TABLE.split(";"))
IDS = list(TABLE)
VOLTS = ("base.dac_zero_f", "base.dac_zero_s", "base.dac_quantisation", "base.steering_law", "base.cross_v_to_w")
POSES = ("base.marker_x", "base.marker_y", "base.marker_yaw", "base.clock_scale", "unknown.base.pose")
_UNKNOWN = {
    "base.v": "humidity 0.04, x 0.06, time_since_rest 0.12, heading 0.05, time 0.08",
    "base.w": "humidity 0.02, y 0.03, time 0.05, heading 0.03",
    "base.pose": "humidity 0.02, x 0.02, y 0.02, time 0.02",
    "laser.range": "humidity 0.008, direction 0.01, hit_x 0.01, hit_y 0.01, abs_v 0.03, time 0.015",
    "laser.spread": "humidity 0.25, direction 0.3, hit_x 0.3, abs_w 0.5, time 0.5",
}
UNKNOWN = [(channel, *one.split()) for channel, many in _UNKNOWN.items() for one in many.split(", ")]
_CONFOUNDED = {
    "speed": "gain_v curvature_v dead_zone_v understeer",
    "left": "left_right_gain gain_w veer curvature_w cross_w_to_v lag_w",
}
CONFOUNDED = [(f"base.{i}", limit) for limit, many in _CONFOUNDED.items() for i in many.split()]


def _size(rng: Rng, sort: str, a: list[float], much: float, usual: bool) -> float:
    if sort in "sp":
        return a[0] * much * (float(rng.choice([-1, 1])) if sort == "s" and not usual else 1.0)
    if sort == "u":
        return float(rng.uniform(a[0], a[1])) if not usual else sum(a) / 2
    if sort == "r":
        return int(rng.integers(1 << 30))
    return a[0] if usual else float(rng.choice(a))


def draw(i: str, rng: Rng, size: float = 1.0, other: bool = False, usual: bool = False) -> Cause:
    """Draw the sizes of a cause, or take the usual ones."""
    p: dict[str, Any] = {}
    much = 1.0 if usual else float(np.exp(rng.uniform(0 if i.startswith("base.") else -0.8, 0.8))) * size
    for word, sort, sizes in re.findall(r"(\w+!?) ([spucr])((?: -?[\d.]+)*)", TABLE[i]):
        p[word.rstrip("!")] = _size(rng, sort, [float(u) for u in sizes.split()], much, usual)
    if "probability" in p:
        p["probability"] = min(p["probability"], 0.9)
    if i == "base.sign" and not usual:
        p["factor_v"], p["factor_w"] = [(1.0, -1.0), (-1.0, 1.0)][int(rng.integers(2))]
    if i == "base.slope" and not usual:
        way = rng.uniform(0, 6.28)
        p["climb_x"], p["climb_y"] = 0.02 * much * np.array([np.cos(way), np.sin(way)])
    return Cause(i, p, other, () if other else tuple(re.findall(r"(\w+)!", TABLE[i])))


def draw_unknown(rng: Rng, size: float) -> Cause:
    """Draw something that the catalogue does not have."""
    channel, of, usual = UNKNOWN[int(rng.integers(len(UNKNOWN)))]
    a = float(usual) * size * float(np.exp(rng.uniform(0, 0.7)) * rng.choice([-1, 1]))
    a = abs(a) if channel == "laser.spread" else a
    p = {"a": a, "of": of, "k": rng.uniform(0.8, 1.6), "f": rng.uniform(0, 3), "period": 35.0}
    return Cause(f"unknown.{channel}", p)
