# SPDX-License-Identifier: BSD-3-Clause
"""What may be hidden, and how it is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from kurumaisu.bench.strangers.marl.rooms import Room
from kurumaisu.bench.strangers.marl.things import Laser, Rng


class Kind(NamedTuple):
    """Usual and largest size, whether it has a sign, whether there is another form, and its parameter's name."""

    usual: float
    top: float
    signed: bool
    forms: bool
    parameter: str = ""


@dataclass
class Cause:
    """Something hidden; channel, of, share, part: where, over what and how something unknown acts."""

    id: str
    size: float
    other: bool = False
    own: dict[str, Any] = field(default_factory=dict)
    channel: str = ""
    of: str = ""
    share: bool = False
    part: int = 0

    @property
    def top(self) -> float:
        """Return the largest size."""
        return 2.0 if self.channel else ALL[self.id].top


Causes = Sequence[Cause]


def size_of(causes: Causes, name: str) -> float:
    """Return a cause's size, 0 where it is not there."""
    return sum(c.size for c in causes if c.id == name)


def _kinds(table: str) -> dict[str, Kind]:
    """Return kinds of a table: id, usual size, largest size, +- if signed, * if there is another form, parameter."""
    out = {}
    for row in table.strip().splitlines():
        name, usual, top, *more = row.split()
        parameter = "".join(m for m in more if m not in ("+-", "*"))
        out[name] = Kind(float(usual), float(top), "+-" in more, "*" in more, parameter)
    return out


BASE = _kinds("""
base.dac_zero_f       0.02   0.3   +- * offset
base.dac_zero_s       0.015  0.3   +- * offset
base.dac_quantisation 0.04   0.3      * step
base.cross_v_to_w     0.02   0.3   +- * share
base.steering_law     1      1          flip
base.dead_zone_v      0.02   0.2      *
base.dead_zone_w      0.02   0.25     *
base.backlash         0.04   0.5      *
base.gain_v           0.05   0.5   +- * gain
base.gain_w           0.05   0.5   +- * gain
base.left_right_gain  0.06   0.6   +- *
base.veer             0.03   0.5   +- * curvature
base.reverse_gain     0.08   0.5   +- * gain
base.curvature_v      0.08   0.8   +- * curvature
base.curvature_w      0.06   0.5   +- * curvature
base.saturation       0.15   1.5      *
base.battery_sag      0.0007 0.006    * sag
base.lag_v            0.12   1.5      * tau
base.lag_w            0.12   1.5      * tau
base.accel_limit      1      12       *
base.payload          0.05   0.4      * droop
base.delay            0.06   0.8      * delay
base.process_noise    8      60
base.understeer       0.15   1.9   +- * k
base.caster_reversal  0.12   1.5   +- *
base.lateral_slip     0.03   0.4   +- * c
base.slope            0.02   0.2      *
base.cross_w_to_v     0.03   0.4   +- *
base.marker_x         0.03   0.6   +-   x
base.marker_y         0.03   0.6   +-   y
base.marker_yaw       0.025  0.5   +-   yaw
base.clock_scale      0.001  0.01  +-
""")
MEAN = _kinds("""
laser.mount_x        0.02   0.4   +-   x
laser.mount_y        0.02   0.4   +-   y
laser.mount_yaw      0.02   0.4   +-   yaw
laser.tilt           0.06   0.35
laser.sweep          0.2    0.95  +-   stretch
laser.latency        0.03   0.5        delay
laser.clock_skew     0.0004 0.004 +-
laser.offset         0.01   0.2   +- * offset
laser.scale          0.005  0.1   +- * scale
laser.quadratic      0.002  0.05  +- * quadratic
laser.warmup         0.012  0.1   +- *
laser.temperature    0.0006 0.008 +- *
laser.cyclic         0.004  0.06     * amplitude
laser.incidence_bias 0.004  0.06  +- *
laser.reflectance    0.015  0.15  +- *
laser.beam_bias      0.004  0.06     *
laser.saturation     0.15   1.5      *
world.map_error      0.008  0.12     *
""")
SCATTER = _kinds("""
laser.range_noise      0.2   3    *
laser.incidence_noise  0.4   6    *
laser.common_mode      0.001 0.05 *
laser.beam_correlation 0.25  0.9  * rho
laser.heavy_tails      0.2   0.4  *
laser.mixed_pixels     0.3   0.95 *
laser.dropout          0.03  0.4  *
laser.crosstalk        0.15  0.6  *
laser.quantisation     0.01  0.1  * step
""")
ALL = BASE | MEAN | SCATTER
VOLTS = {"base." + k for k in ("dac_zero_f", "dac_zero_s", "dac_quantisation", "cross_v_to_w", "steering_law")}
SPREAD = ("laser.range_noise", "laser.incidence_noise")
UNKNOWN = {
    "base.v": "humidity time time_since_rest x y heading tyre abs_v",
    "base.w": "humidity time y x heading tyre w",
    "base.pose": "x y heading",
    "laser.range": "humidity bearing direction hit_x hit_y abs_v range time abs_w",
    "laser.spread": "humidity bearing abs_w time abs_v hit_x",
}
UNKNOWN_SIZE = {"base.v": 0.06, "base.w": 0.06, "base.pose": 0.01, "laser.range": 0.008, "laser.spread": 0.4}
CONFOUNDED = (
    ("base.gain_v", "one_speed"),
    ("base.curvature_v", "one_speed"),
    ("base.dead_zone_v", "one_speed"),
    ("base.gain_w", "left"),
    ("base.left_right_gain", "left"),
)
OWN: dict[str, Callable[[Rng], dict[str, Any]]] = {
    "base.accel_limit": lambda rng: {"ratio": rng.uniform(0.2, 0.8)},
    "base.payload": lambda rng: {"tau": rng.uniform(0.05, 0.2)},
    "base.caster_reversal": lambda rng: {"length": rng.uniform(0.15, 0.5)},
    "base.slope": lambda rng: {"way": rng.uniform(-np.pi, np.pi)},
    "laser.tilt": lambda rng: {"way": rng.uniform(-0.6, 0.6)},
    "laser.warmup": lambda rng: {"tau": rng.uniform(150, 400)},
    "laser.cyclic": lambda rng: {"wavelength": rng.uniform(0.4, 2.5), "phase": rng.uniform(-3, 3)},
    "laser.beam_bias": lambda rng: {"phase": rng.uniform(-3, 3), "draw": rng.standard_normal(1100)},
    "world.map_error": lambda rng: {"draw": rng.standard_normal(400)},
}


def _cause(rng: Rng, name: str, other: bool = False, size: float | None = None) -> Cause:
    """Return a cause with its size and whatever else its equation needs."""
    kind = ALL[name]
    if size is None:
        size = kind.usual * np.exp(rng.uniform(-0.3, 0.6))
        if name in MEAN:
            size *= np.exp(rng.uniform(-1.2, 0))
        if name == "base.steering_law":
            size = 1.0
        size = min(size, kind.top) * (rng.choice([-1, 1]) if kind.signed else 1)
    return Cause(name, size, other, OWN[name](rng) if name in OWN else {})


def _unknown(rng: Rng) -> Cause:
    pairs = [(channel, of) for channel, every in UNKNOWN.items() for of in every.split()]
    channel, of = pairs[rng.integers(len(pairs))]
    part = int(rng.integers(2)) if of != "heading" else 2
    size = UNKNOWN_SIZE[channel] * np.exp(rng.uniform(-0.3, 0.5))
    share = bool(rng.random() < 0.5)
    return Cause(channel.split(".")[0] + ".unknown", size, channel=channel, of=of, share=share, part=part)


def _fit(ids: set[str]) -> bool:
    """Return whether causes can be told from each other."""
    if "base.clock_scale" in ids and ids & {*MEAN, *SCATTER}:
        return False
    if "base.steering_law" in ids and (ids & (VOLTS | {"base.dead_zone_w"})) != {"base.steering_law"}:
        return False
    if len(ids & (SCATTER.keys() - {"laser.dropout", "laser.range_noise"})) > 1:
        return False
    return len(ids) == 1 or not ids <= SCATTER.keys()


def draw_causes(rng: Rng, kind: str) -> tuple[list[Cause], str]:
    """Return the hidden causes, and how the drives are limited."""
    if kind in ("null", "wrong"):
        return [], ""
    if kind == "confounded":
        name, limit = CONFOUNDED[rng.integers(len(CONFOUNDED))]
        return [_cause(rng, name)], limit
    if kind == "unknown":
        return [_unknown(rng)], ""
    form = kind == "form"
    pool = [k for k in ALL if not form or ALL[k].forms]
    while True:
        ids = [pool[i] for i in rng.choice(len(pool), {"pair": 2, "triple": 3}.get(kind, 1), replace=False)]
        if _fit(set(ids)):
            return [_cause(rng, i, form) for i in ids], ""


def settle(c: Cause, room: Room, laser: Laser | None) -> None:
    """Set what of a cause depends on the room and the laser."""
    if c.id == "world.map_error":
        seg = room.seg
        if c.other:
            mid = np.tile(seg.reshape(-1, 2).mean(0), 2)
            c.own["seg"] = mid + (seg - mid) * (1 + c.size * 0.6)
        else:
            e = seg[:, 2:] - seg[:, :2]
            n = np.stack([e[:, 1], -e[:, 0]], 1) / np.hypot(e[:, 0], e[:, 1])[:, None]
            s = n * c.size * c.own["draw"][room.box * 4 + np.arange(len(seg)) % 4][:, None]
            c.own["seg"] = seg + np.tile(s, 2)
    elif c.id == "laser.saturation" and laser:
        c.own["far"] = 0.85 * min(laser.far, 6.0)


def _rival_names(chair: bool, laser: bool) -> Iterator[str]:
    for name in ALL:
        if name in ("base.process_noise", "base.steering_law") or (name in VOLTS and not chair):
            continue
        if name == "base.clock_scale" and laser:
            continue
        if name in BASE or (laser and (name in MEAN or name in SPREAD)):
            yield name


def rivals(rng: Rng, chair: bool, room: Room, laser: Laser | None) -> list[Cause]:
    """Return what else might explain effects."""
    out = list[Cause]()
    for name in _rival_names(chair, laser is not None):
        for other in [False, True] if name == "laser.range_noise" else [name == "world.map_error"]:
            c = _cause(rng, name, other, ALL[name].usual)
            settle(c, room, laser)
            out += [replace(c, own={"way": way}) for way in (0.0, np.pi / 2)] if name == "base.slope" else [c]
    return out
