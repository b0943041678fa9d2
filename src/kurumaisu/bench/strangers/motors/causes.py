# SPDX-License-Identifier: BSD-3-Clause
"""What can be hidden: the broken part, and what a careful engineer would call it."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Cause:
    """A fault: its values at size 1, and its name."""

    id: str
    why: str
    fault: dict[str, float]
    names: dict[str, float] = field(default_factory=dict)  # the catalogue's parameters at size 1
    signed: bool = True
    form: str = "plain"
    channel: str = ""  # of an unknown
    follows: tuple[str, ...] = ()
    style: str = ""  # of drive
    wide: bool = True  # not: its size keeps near the typical one

    @property
    def laser(self) -> bool:
        """Whether it is the laser's."""
        return self.id.startswith(("laser.", "world.")) or self.channel in ("range", "scatter")


def _base(name: str, why: str, fault: dict[str, float], signed: bool = True, style: str = "", **names: float) -> Cause:
    return Cause("base." + name, why, fault, names, signed, style=style)


def _laser(name: str, why: str, fault: dict[str, float], signed: bool = True, **names: float) -> Cause:
    return Cause(("world." if name == "map_error" else "laser.") + name, why, fault, names, signed)


BASE = [
    _base("dac_zero_f", "the op-amp behind the D/A has an offset", {"dac_f": 0.01}, offset=0.01),
    _base("dac_zero_s", "the op-amp behind the D/A has an offset", {"dac_s": 0.01}, offset=0.01),
    _base("dac_quantisation", "low bits of the D/A are stuck", {"dac_step": 0.03}, False, step=0.03),
    _base("delay", "the bus to the joystick's input is slow", {"delay": 0.05}, False, delay=0.05),
    _base(
        "dead_zone_v",
        "worn potentiometer: wider dead band of the translation input",
        {"band_f": 0.03},
        False,
        width=0.03,
    ),
    _base(
        "dead_zone_w", "worn potentiometer: wider dead band of the steering input", {"band_s": 0.03}, False, width=0.03
    ),
    _base("backlash", "a loose coupling in the steering pot's drive", {"play": 0.04}, False),
    _base("cross_v_to_w", "the two analogue lines share a ground", {"leak": 0.01}, share=0.01),
    _base("gain_v", "gain of the translation amplifier", {"amp_v": 0.04}, gain=0.04),
    _base("gain_w", "tyres touch the floor at another track", {"track": -0.04}),
    _base("left_right_gain", "steering pot with a bent track", {"amp_lr": 0.04}),
    _base("veer", "wheels of unequal diameter", {"wear_l": -0.0081, "wear_r": 0.0081}, curvature=0.03),
    _base("reverse_gain", "brushes advanced for forward running", {"amp_rev": 0.05}, style="stops", gain=0.05),
    _base("curvature_v", "amplifier that compresses", {"bend_v": 0.05}, curvature=0.05),
    _base("curvature_w", "amplifier that compresses", {"bend_w": 0.05}, curvature=0.05),
    _base("saturation", "speed limit in the joystick's electronics", {"inv_v": 1.6, "inv_w": 1.4}, False),
    _base(
        "battery_sag", "the speed loop's set point follows a battery that runs down", {"sag": 0.001}, False, sag=0.001
    ),
    _base("lag_v", "capacitor on the translation line", {"rc_v": 0.1}, False, tau=0.1),
    _base("lag_w", "capacitor on the steering line", {"rc_w": 0.1}, False, tau=0.1),
    _base("accel_limit", "soft start of the controller", {"slow_v": 1.5, "slow_w": 0.7}, False),
    _base("payload", "a weak loop under a heavy passenger", {"soft": 0.1, "droop": 0.04}, False, droop=0.04, tau=0.1),
    _base("understeer", "soft tyres: casters' side force grows with the speed", {"under": 0.1}, k=0.1),
    _base("caster_reversal", "a worn caster pin", {"kick": 0.1}, style="stops"),
    _base("lateral_slip", "soft tyres creep sideways", {"slip": 0.03}, c=0.03),
    _base("slope", "the floor slopes, and the loop senses speed by back-EMF", {"grade_x": 0.012, "grade_y": 0.008}),
    _base("marker_x", "the marker is not over the axle", {"mx": 0.03}, x=0.03),
    _base("clock_scale", "the reference's clock runs at another speed", {"clock": 0.002}),
]
TWINS = [
    _base("marker_y", "the marker is beside base_link", {"my": 0.03}, y=0.03),
    _base("cross_w_to_v", "base_link is not in the middle of the axle", {"my": -0.03}, lever=0.03),
]


def _form(
    name: str, why: str, fault: dict[str, float], signed: bool = True, style: str = "", wide: bool = True
) -> Cause:
    return Cause(name, why, fault, {}, signed, "other", style=style, wide=wide)


OTHER = [
    _form("base.lag_v", "two RC stages on the translation line", {"rc_v": 0.08, "rc2_v": 0.08}, False),
    _form("base.lag_w", "two RC stages on the steering line", {"rc_w": 0.08, "rc2_w": 0.08}, False),
    _form("base.dead_zone_v", "stiction: nothing below a voltage, all above it", {"stick_f": 0.1}, False),
    _form("base.dead_zone_v", "a dead band with soft corners", {"soft_f": 0.05}, False),
    _form("base.dead_zone_w", "a dead band with soft corners", {"soft_s": 0.05}, False),
    _form("base.battery_sag", "a battery that collapses at the end", {"collapse": 0.1}, False),
    _form("base.understeer", "understeer that saturates", {"under_sat": 0.06}, False),
    _form("base.caster_reversal", "casters that swing about a stiff pin", {"scrub": 0.08}, style="stops"),
    _form("base.saturation", "low battery: the faster wheel meets the voltage limit", {"low": 17.0}, False, wide=False),
    _form("base.accel_limit", "soft start, but quick braking", {"slow_v": 2, "slow_w": 1, "slow_down": 1}, False),
    _form("base.lateral_slip", "slip angle by side force", {"slip2": 0.06}),
    _form("base.delay", "a busy network: the delay wanders", {"delay_wander": 0.1}, False),
    _form("base.payload", "weak loop, mass far from the axle", {"soft": 0.1, "droop": 0.04, "far": 1.0}, False),
    _form("base.slope", "a heavy chair is slower uphill, but held back downhill", {"grade_up": 0.03}, False),
    _form("base.curvature_v", "gain falls with the speed's square", {"cube_v": 0.1}),
    _form("base.curvature_w", "gain falls with the yaw rate's square", {"cube_w": 0.08}),
    _form("laser.cyclic", "a phase meter that is rather square than sinusoidal", {"sharp": 0.003}),
    _form("laser.incidence_bias", "bias at grazing incidence only", {"slant_sat": 0.01}),
    _form("laser.warmup", "electronics that warm at an even rate, then hold", {"set_in": 0.02}),
    _form("laser.range_noise", "noise that grows with the range's square", {"range_noise": 0.1}, False),
    _form("laser.mixed_pixels", "a dirty window widens the beam", {"wide": 0.001}, False),
    _form("laser.heavy_tails", "rare readings that are too long", {"skewed": 0.001}, False),
    _form("laser.latency", "every other while scans wait in a buffer", {"delay_some": 0.05}, False),
]
LASER = [
    _laser("mount_x", "bracket too far forward", {"x": 0.01}, x=0.01),
    _laser("mount_y", "bracket too far to the side", {"y": 0.01}, y=0.01),
    _laser("mount_yaw", "bracket turned", {"yaw": 0.005}, yaw=0.005),
    _laser("tilt", "bracket bent", {"pitch": 0.05, "roll": 0.01}),
    _laser("sweep", "motor off its speed", {"stretch": 0.1}),
    _laser("latency", "scans wait in a buffer", {"delay": 0.02}),
    _laser("clock_skew", "quartz off its frequency", {"skew": 0.0005}),
    _laser("offset", "datum of the housing", {"offset": 0.003}, offset=0.003),
    _laser("scale", "modulation frequency off", {"scale": -0.002}, False, scale=-0.002),
    _laser("quadratic", "gain of the receiver changes with the range", {"quad": 0.001}, quadratic=0.001),
    _laser("warmup", "electronics still warming", {"warm": 0.01}),
    _laser("temperature", "electronics without temperature compensation", {"temp": 0.0005}, coefficient=0.0005),
    _laser("cyclic", "crosstalk of the phase meter", {"cyclic": 0.003}),
    _laser("incidence_bias", "a slanted wall returns the near side of the beam first", {"slant": 0.002}),
    _laser("reflectance", "weak echoes of dark walls come late", {"dark": 0.003}),
    _laser("beam_bias", "the mirror is not flat", {"beam": 0.001}, False, sd=0.001),
    _laser("range_noise", "a weak diode", {"noise": 0.1}, share=0.1),
    _laser("incidence_noise", "spread of the echo on slanted walls", {"slant_noise": 0.1}, False),
    _laser("beam_correlation", "an amplifier that settles over beams", {"rho": 0.15}, False),
    _laser("heavy_tails", "spikes on the supply", {"tails": 0.001}, False),
    _laser("mixed_pixels", "beams split by edges", {"mixed": 0.03}, False),
    _laser("saturation", "the receiver saturates far off", {"far": 0.26}, False, inverse_far=0.26),
    _laser("crosstalk", "another laser in the room", {"talk": 0.02}, False),
    _laser("quantisation", "a driver that drops low bits", {"step": 0.006}, False, step=0.006),
    _laser("map_error", "the room was taped carelessly", {"map_sd": 0.005}, False, sd=0.005),
]


def _odd(channel: str, why: str, fault: dict[str, float], *follows: str, signed: bool = True, style: str = "") -> Cause:
    return Cause("unknown", why, fault, {}, signed, "other", channel, follows, style)


UNKNOWN = [
    _odd(
        "v",
        "cold grease: slow in the first seconds after each rest",
        {"cold": 0.15},
        "since_rest",
        signed=False,
        style="stops",
    ),
    _odd("w", "a flat spot on the left tyre", {"flat": 0.1}, "wheel_left", "distance"),
    _odd("v", "a carpet on half of the floor", {"carpet": 0.05}, "x", "y"),
    _odd("v", "a drag that comes and goes with the distance driven", {"heat": 0.06}, "distance", signed=False),
    _odd("v", "tyre pressure, logged, changes the gain", {"pressure": 0.05}, "pressure", "time"),
    _odd("lateral", "a cross slope lets the chair slide", {"bank": 0.012}, "heading"),
    _odd("lateral", "a bent axle: the chair crabs", {"crab": 0.02}, "v", "v_f"),
    _odd("w", "gusts from a fan, now and then", {"gust": 0.05}, "time"),
    _odd("v", "lost packets: old commands hold", {"lost": 1.0}, "time", signed=False),
    _odd("v", "the tyres scrub in curves", {"lean": 0.08}, "abs_w", "v_times_w"),
    _odd("v", "the passenger rocks after each change of speed", {"rock": 0.15}, "since_command", "since_rest", "time"),
    _odd("w", "a soft carpet pulls to one side on half of the floor", {"mud": 0.05}, "x", "y"),
    _odd("reference", "a compass in the reference, near iron", {"compass": 0.03}, "heading"),
    _odd("reference", "the reference's camera has a lens error", {"lens": 0.01}, "x", "y"),
    _odd("range", "sunlight from a window", {"sun": 0.004}, "direction"),
    _odd("range", "haze in half of the room", {"fog": 0.003}, "x", "y"),
    _odd("range", "the bracket nods when it drives", {"shake": 0.01}, "v"),
    _odd("range", "the laser was knocked at 25 s", {"jolt": 0.003}, "time", "scan"),
    _odd("scatter", "vibration when it drives", {"shake_sd": 0.15}, "v", signed=False),
    _odd("scatter", "sunlight from a window", {"sun_sd": 0.3}, "direction", signed=False),
    _odd("scatter", "a lamp that flickers", {"blink_sd": 0.15}, "time", "scan", signed=False),
]
CONFOUNDED = {  # by the style of driving: what may act
    "one_speed": ["gain_v", "curvature_v", "dac_zero_f", "dead_zone_v"],
    "left": ["left_right_gain", "gain_w"],
    "one_circle": ["gain_v", "gain_w", "curvature_w", "left_right_gain", "lateral_slip", "marker_x"],
    "forward": ["dac_zero_f", "dead_zone_v", "marker_y", "cross_w_to_v"],
    "wander": ["marker_y", "cross_w_to_v"],
}
