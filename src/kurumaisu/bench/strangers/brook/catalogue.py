# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue as tables: usual sizes, what is signed or has one form, unknowns, drives, wrong data."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


def table(prefix: str, text: str) -> dict[str, float]:
    """Ids with a usual size each."""
    words = text.split()
    return {prefix + k: float(v) for k, v in zip(words[::2], words[1::2], strict=True)}


def words(text: str) -> tuple[str, ...]:
    """The words of a text."""
    return tuple(text.split())


USUAL_BASE = table(
    "base.",
    """
dac_zero_f 0.01 dac_zero_s 0.01 dac_quantisation 0.03 delay 0.05 dead_zone_v 0.03 dead_zone_w 0.03 backlash 0.05
cross_v_to_w 0.01 gain_v 0.05 gain_w 0.05 left_right_gain 0.08 veer 0.03 reverse_gain 0.08 curvature_v 0.08
curvature_w 0.08 saturation 0.15 battery_sag 0.0012 cross_w_to_v 0.03 lag_v 0.1 lag_w 0.1 accel_limit 0.7
payload 0.05 understeer 0.2 caster_reversal 0.15 lateral_slip 0.03 slope 0.015 marker_x 0.03 marker_y 0.03
clock_scale 0.002
""",
)
USUAL_LASER = table(
    "",
    """
laser.mount_x 0.01 laser.mount_y 0.01 laser.mount_yaw 0.01 laser.tilt 0.04 laser.sweep 0.1 laser.latency 0.02
laser.clock_skew 0.001 laser.offset 0.005 laser.scale 0.003 laser.quadratic 0.001 laser.warmup 0.01
laser.temperature 0.0005 laser.cyclic 0.003 laser.incidence_bias 0.002 laser.reflectance 0.01
laser.beam_bias 0.001 laser.range_noise 0.1 laser.incidence_noise 0.2 laser.beam_correlation 0.15
laser.heavy_tails 0.005 laser.mixed_pixels 0.1 laser.saturation 0.1 laser.crosstalk 0.03
laser.quantisation 0.004 world.map_error 0.002
""",
)
USUAL = {**USUAL_BASE, **USUAL_LASER}
TWINS = ("base.marker_y", "base.cross_w_to_v")
BASE, LASER = tuple(k for k in USUAL_BASE if k not in TWINS), tuple(USUAL_LASER)
SCATTER = words("""
laser.range_noise laser.incidence_noise laser.quantisation laser.beam_correlation unknown.shake unknown.blur
""")
RARE = ("laser.heavy_tails", "laser.mixed_pixels", "laser.crosstalk", "laser.saturation")
GEOMETRY = words("""
laser.mount_x laser.mount_y laser.mount_yaw laser.sweep laser.latency laser.clock_skew world.map_error
""")
BENT = words("""
base.dac_quantisation base.dead_zone_v base.dead_zone_w base.backlash base.saturation base.lag_v base.lag_w
base.accel_limit
""")
ONE_FORM = words("""
base.marker_x base.marker_y base.clock_scale laser.mount_x laser.mount_y laser.sweep laser.clock_skew
laser.offset laser.tilt laser.mixed_pixels laser.crosstalk laser.saturation laser.quantisation world.map_error
""")
SIGNED = words("""
base.dac_zero_f base.dac_zero_s base.cross_v_to_w base.gain_v base.gain_w base.left_right_gain base.veer
base.reverse_gain base.cross_w_to_v base.caster_reversal base.marker_x base.marker_y base.clock_scale
laser.mount_x laser.mount_y laser.mount_yaw laser.sweep laser.latency laser.clock_skew laser.offset laser.scale
laser.quadratic laser.warmup laser.temperature laser.incidence_bias laser.reflectance
""")
PUSHED = words("dead_zone lag accel saturation payload sag backlash delay curvature understeer quantisation")
# unknown: id, size, channel, what it follows
_UNKNOWN = """
rest_v 0.15 v since_rest
shake 0.15 scatter v,abs_v
compass 0.03 reference heading
sun 0.003 range direction
flat_spot 0.05 v distance
gusts 0.15 w time
column_v 0.05 v tyre_pressure
speed_r 0.002 range v,abs_v
place_v 0.08 v x,y
camber 0.01 lateral heading
blur 0.15 scatter w,abs_w
rest_w 0.15 w since_rest
lost 0.3 v time
haze 0.003 range x
swell 0.05 v time
camera 0.02 reference x
column_w 0.02 w tyre_pressure
column_r 0.001 range tyre_pressure
spells 0.002 range time,scan
"""
UNKNOWN = {
    "unknown." + k: (float(size), channel, tuple(what.split(",")))
    for k, size, channel, what in (row.split() for row in _UNKNOWN.strip().splitlines())
}
# drives in which these are the same; marker_y and cross_w_to_v are the same motion always
_MODES = """
one_speed gain_v dac_zero_f dead_zone_v curvature_v
left gain_w left_right_gain
arc gain_v veer cross_w_to_v gain_w
free marker_y cross_w_to_v
back gain_v reverse_gain
one_rate gain_w curvature_w left_right_gain dead_zone_w dac_zero_s
"""
MODES = {row.split()[0]: tuple("base." + k for k in row.split()[1:]) for row in _MODES.strip().splitlines()}
_WRONGS = """
positions in mm; headings in degrees; yaw command of the wrong sign; x and y of the poses swapped; compass
headings; clock of the poses off by seconds; stamps of the poses in ms; a run is another run again; fan
mirrored; another map; ranges in mm; speed command of the wrong sign; voltages in mV; speeds in km/h; y of the
wrong sign; yaw command in degrees; clock of the scans off by seconds; positions in cm; command columns swapped;
headings folded to half a turn
"""
WRONGS = tuple(" ".join(_WRONGS.split()).split("; "))
_PLAIN = words("""
base.dac_zero_f:offset base.dac_zero_s:offset base.dac_quantisation:step base.delay:delay base.dead_zone_v:width
base.dead_zone_w:width base.gain_v:gain base.gain_w:gain base.veer:curvature base.reverse_gain:gain
base.curvature_v:curvature base.lag_v:tau base.curvature_w:curvature base.battery_sag:sag
base.cross_w_to_v:lever base.lag_w:tau base.cross_v_to_w:share base.understeer:k base.lateral_slip:c
base.marker_x:x base.marker_y:y laser.mount_x:x laser.mount_y:y laser.mount_yaw:yaw laser.sweep:stretch
laser.offset:offset laser.scale:scale laser.quadratic:quadratic laser.beam_bias:sd laser.range_noise:share
laser.beam_correlation:rho laser.mixed_pixels:probability laser.quantisation:step laser.temperature:coefficient
""")
PLAIN: dict[str, str] = dict(w.split(":", 1) for w in _PLAIN)
FAR = 4.0  # of the laser's gate


@dataclass
class Effect:
    """One hidden cause: its id, one size, whether it has the other form, and fixed further numbers."""

    ident: str
    size: float
    other: bool = False
    more: dict[str, float] = field(default_factory=dict)


def on_base(e: Effect) -> bool:
    """Whether a cause is of the base (or of its reference)."""
    return e.ident in USUAL_BASE or (e.ident in UNKNOWN and UNKNOWN[e.ident][1] in ("v", "w", "lateral", "reference"))


def effect(rng: np.random.Generator, ident: str, other: bool = False) -> Effect:
    """Draw one effect near its typical size."""
    size = (UNKNOWN[ident][0] if ident in UNKNOWN else USUAL[ident]) * float(np.exp(rng.uniform(-0.5, 0.6)))
    if ident in SIGNED and rng.uniform() < 0.5:
        size = -size
    more = {
        "axis": float(rng.integers(2)),
        "uphill": rng.uniform(-np.pi, np.pi),
        "length": rng.uniform(0.6, 1.2)
        if ident == "unknown.flat_spot"
        else rng.uniform(1.5, 3.0)
        if "camera" in ident
        else rng.uniform(0.15, 0.4),
        "phase": rng.uniform(0, 2 * np.pi),
        "period": rng.uniform(2, 4) if ident == "unknown.spells" else rng.uniform(12, 25),
        "wavelength": rng.uniform(2, 4),
        "tau": rng.uniform(80, 200),
        "seed": float(rng.integers(1 << 30)),
        "drift": rng.uniform(0.2, 0.8),
        "split": rng.uniform(-0.5, 0.8),
        "side": rng.uniform(-np.pi, np.pi),
    }
    return Effect(ident, size, other, more)


def usual(e: Effect) -> float:
    """The usual size of an effect."""
    return (
        UNKNOWN[e.ident][0]
        if e.ident in UNKNOWN
        else USUAL[e.ident] * (0.3 if e.ident in LASER and e.ident not in SCATTER + RARE else 1.0)
    )


def parameters(e: Effect) -> dict[str, float]:
    """The catalogue's parameters, where they mean the same here."""
    if e.other:
        return {}
    k, m = e.size, e.more
    if e.ident == "base.accel_limit":
        return {"slowness_v": k, "slowness_w": k / 2}
    if e.ident == "base.payload":
        return {"droop": k, "tau": 2 * k}
    if e.ident == "base.slope":
        return {"climb_x": float(k * np.cos(m["uphill"])), "climb_y": float(k * np.sin(m["uphill"]))}
    if e.ident == "base.saturation":
        return {"inverse_w" if m["axis"] else "inverse_v": 1 / max(m["top"] - k, 0.05)}
    if e.ident == "laser.saturation":
        return {"inverse_far": 1 / (FAR - k)}
    return {PLAIN[e.ident]: k} if e.ident in PLAIN else {}
