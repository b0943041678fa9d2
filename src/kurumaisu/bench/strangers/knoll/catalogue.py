# SPDX-License-Identifier: BSD-3-Clause
"""What can be hidden, and something that no catalogue has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.knoll import base_causes, range_causes, scatter_causes
from kurumaisu.bench.strangers.knoll.signals import since
from kurumaisu.bench.strangers.knoll.things import Cause, Draw, Drive, Hits, Maker, Rng, Scene
from kurumaisu.types import FloatArray

BASE = list(base_causes.MAKERS)
SCATTER = {"process_noise", *scatter_causes.MAKERS}
_LASER = range_causes.MAKERS | scatter_causes.MAKERS | range_causes.WORLD
LASER = list(_LASER)  # and the map's
VOLTAGE = {"dac_zero_f", "dac_zero_s", "dac_quantisation", "steering_law", "cross_v_to_w"}
PLAIN = {"clock_scale", "sweep", "mount_yaw"}  # have one form only
CONFOUNDED = [
    *[(name, "one_speed") for name in ("gain_v", "curvature_v", "dead_zone_v", "understeer", "veer")],
    *[(name, "left") for name in ("gain_w", "left_right_gain")],
    *[(name, "one_turn") for name in ("curvature_w", "gain_w", "dead_zone_w")],
    *[("lateral_slip", "one_speed"), ("cross_w_to_v", "left")],
]


def draw_cause(name: str, rng: Rng, scene: Scene, size: float, other: bool = False) -> Cause:
    """Draw a cause; size 1 is usual."""
    s = float(size * rng.uniform(0.8, 1.6))
    d = Draw(rng, scene, s, float(s * rng.choice([-1, 1])), other)
    c = Cause(("base." if name in BASE else "laser.") + name, other)
    (base_causes.MAKERS if name in BASE else _LASER)[name](c, d)
    return c


def _humidity(x: Drive | Hits) -> FloatArray:
    return np.asarray((x.cov["humidity"] - 55) / 12)


def _v_hum(c: Cause, d: Draw) -> None:
    c.rate = lambda x, v, w, u: (v * (1 + 0.06 * d.signed * _humidity(x)), w, u)


def _w_hum(c: Cause, d: Draw) -> None:
    c.rate = lambda x, v, w, u: (v, w + 0.04 * d.signed * _humidity(x) * (v != 0), u)


def _turning(c: Cause, much: Callable[[Any, Any], Any]) -> None:
    c.place = lambda x, y, th, v, w: (v, w + np.where(np.abs(v) > 0.01, much(x, th), 0.0))


def _w_x(c: Cause, d: Draw) -> None:
    s, width = d.signed, d.scene.room.width
    _turning(c, lambda x, th: 0.05 * s * np.sin(2 * np.pi * x / width))


def _w_heading(c: Cause, d: Draw) -> None:
    s, a = d.signed, d.rng.uniform(0, 6)
    _turning(c, lambda x, th: 0.05 * s * np.sin(th - a))


def _v_rest(c: Cause, d: Draw) -> None:
    s = abs(d.signed)
    c.rate = lambda x, v, w, u: (v * (1 - 0.12 * s * np.exp(-since((x.vc == 0) & (x.wc == 0)) / 4.0)), w, u)


def _v_y(c: Cause, d: Draw) -> None:
    s, depth = d.signed, d.scene.room.depth
    c.place = lambda x, y, th, v, w: (v * (1 - 0.1 * s * np.tanh((y - depth / 2) / 0.4)), w)


def _v_heading2(c: Cause, d: Draw) -> None:
    s, a = d.signed, d.rng.uniform(0, 3)
    c.place = lambda x, y, th, v, w: (v * (1 + 0.08 * s * np.cos(2 * (th - a))), w)


def _burst(c: Cause, d: Draw) -> None:
    starts, lengths = d.rng.uniform(0, 2000, 250), d.rng.uniform(0.4, 1.5, 250)

    def on(t: FloatArray) -> FloatArray:
        return np.asarray(np.any([(t > a) & (t < a + b) for a, b in zip(starts, lengths, strict=True)], axis=0))

    c.rate = lambda x, v, w, u: (v, w + 0.12 * d.signed * on(x.day + x.t) * (v != 0), u)


def _pose_y(c: Cause, d: Draw) -> None:
    s, depth = d.signed, d.scene.room.depth
    c.warp = lambda t, x, y, th: (0.03 * s * np.sin(2 * np.pi * y / depth * 1.3), 0 * t, 0 * t)


def _pose_heading(c: Cause, d: Draw) -> None:
    c.warp = lambda t, x, y, th: (0 * t, 0 * t, 0.03 * d.signed * np.sin(2 * th))


def _r_hum(c: Cause, d: Draw) -> None:
    c.mean = lambda mu, g: mu + 0.009 * d.signed * (g.cov["humidity"] - 55) / 12


def _r_speed(c: Cause, d: Draw) -> None:
    c.mean = lambda mu, g: mu + 0.012 * d.signed * np.abs(g.v) / d.scene.vmax


def _r_dir(c: Cause, d: Draw) -> None:
    c.mean = lambda mu, g: mu + 0.009 * d.signed * np.exp(2 * np.cos(g.ang - 1.1) - 2)


def _s_speed(c: Cause, d: Draw) -> None:
    c.sd = lambda x, g: x * (1 + 0.8 * abs(d.signed) * (np.abs(g.v) / d.scene.vmax))


def _s_hum(c: Cause, d: Draw) -> None:
    c.sd = lambda x, g: x * (1 + 0.8 * abs(d.signed) * np.clip((g.cov["humidity"] - 45) / 20, 0, 2))


def _s_turn(c: Cause, d: Draw) -> None:
    c.sd = lambda x, g: x * (1 + 0.8 * abs(d.signed) * (np.abs(g.w) / d.scene.wmax))


_UNKNOWN: dict[str, tuple[Maker, str, str]] = {
    "v_hum": (_v_hum, "base.v", "humidity"),
    "w_hum": (_w_hum, "base.w", "humidity"),
    "w_x": (_w_x, "base.w", "x"),
    "v_rest": (_v_rest, "base.v", "time_since_rest"),
    "v_y": (_v_y, "base.v", "y"),
    "w_heading": (_w_heading, "base.w", "heading"),
    "burst": (_burst, "base.w", "time"),
    "pose_y": (_pose_y, "base.pose", "y"),
    "pose_heading": (_pose_heading, "base.pose", "heading"),
    "v_heading2": (_v_heading2, "base.v", "heading"),
    "r_hum": (_r_hum, "laser.range", "humidity"),
    "r_speed": (_r_speed, "laser.range", "abs_v"),
    "r_dir": (_r_dir, "laser.range", "direction"),
    "s_speed": (_s_speed, "laser.spread", "abs_v"),
    "s_hum": (_s_hum, "laser.spread", "humidity"),
    "s_turn": (_s_turn, "laser.spread", "abs_w"),
}


def draw_unknown(rng: Rng, scene: Scene, size: float) -> Cause:
    """Draw something that is not in the catalogue."""
    s = float(size * rng.uniform(0.8, 1.5) * rng.choice([-1, 1]))
    kinds = [name for name, (_, channel, _) in _UNKNOWN.items() if scene.fan or channel.startswith("base.")]
    name = kinds[rng.integers(len(kinds))]
    maker, channel, covariate = _UNKNOWN[name]
    c = Cause("unknown." + name, order=9, unknown=(channel, covariate))
    maker(c, Draw(rng, scene, abs(s), s))
    return c
