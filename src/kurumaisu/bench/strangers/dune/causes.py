# SPDX-License-Identifier: BSD-3-Clause
"""Which causes there are, with their usual size, and which are hidden in a recording."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .odd import UNKNOWN
from .plant import Cause

KINDS = ["null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong"]
Ranges = dict[str, tuple[float, float]]
WAVE: Ranges = {"wavelength": (0.8, 2.0), "phase": (0, 6.28)}
BURST: Ranges = {"width": (0.2, 0.4), "drift": (0.3, 0.8), "reach": (3, 4), "seed": (1, 1e6)}
# id: what grows with the size, what does not, either sign?, another form?, parameters that mean the catalogue's
TABLE: dict[str, tuple[dict[str, float], Ranges, bool, bool, tuple[str, ...]]] = {
    "base.dac_zero_f": ({"offset": 0.03}, {}, True, False, ("offset",)),
    "base.dac_zero_s": ({"offset": 0.02}, {}, True, False, ("offset",)),
    "base.dac_quantisation": ({"step": 0.06}, {}, False, True, ("step",)),
    "base.delay": ({"delay": 0.08}, {}, False, True, ("delay",)),
    "base.dead_zone_v": ({"width": 0.04}, {}, False, True, ("width",)),
    "base.dead_zone_w": ({"width": 0.02}, {}, False, True, ("width",)),
    "base.backlash": ({"play": 0.05}, {}, False, True, ()),
    "base.cross_v_to_w": ({"share": 0.02}, {}, True, True, ("share",)),
    "base.gain_v": ({"gain": 0.05}, {}, True, False, ("gain",)),
    "base.gain_w": ({"gain": 0.05}, {}, True, False, ("gain",)),
    "base.left_right_gain": ({"asymmetry": 0.05}, {}, True, True, ()),
    "base.veer": ({"curvature": 0.04}, {}, True, True, ("curvature",)),
    "base.reverse_gain": ({"gain": 0.15}, {}, True, True, ("gain",)),
    "base.curvature_v": ({"curvature": 0.1}, {}, False, True, ("curvature",)),
    "base.curvature_w": ({"curvature": 0.1}, {}, False, True, ("curvature",)),
    "base.saturation": ({"inverse_v": 1.9}, {}, False, True, ("inverse_v",)),
    "base.battery_sag": ({"sag": 0.002}, {}, False, True, ("sag",)),
    "base.cross_w_to_v": ({"lever": 0.03}, {}, True, True, ("lever",)),
    "base.lag_v": ({"tau": 0.12}, {}, False, True, ("tau",)),
    "base.lag_w": ({"tau": 0.12}, {}, False, True, ("tau",)),
    "base.accel_limit": ({"slowness_v": 1.5, "slowness_w": 0.8}, {}, False, True, ("slowness_v", "slowness_w")),
    "base.payload": ({"droop": 0.05, "tau": 0.1}, {}, False, True, ("droop", "tau")),
    "base.understeer": ({"k": 0.3}, {}, False, True, ("k",)),
    "base.caster_reversal": ({"kick": 0.2}, {"length": (0.2, 0.45)}, True, True, ()),
    "base.lateral_slip": ({"c": 0.05}, {}, False, True, ("c",)),
    "base.slope": ({"climb_x": 0.02, "climb_y": 0.01}, {}, True, True, ("climb_x", "climb_y")),
    "base.marker_x": ({"x": 0.02}, {}, True, False, ("x",)),
    "base.marker_y": ({"y": 0.02}, {}, True, False, ("y",)),
    "base.clock_scale": ({"scale": 0.003}, {}, True, True, ()),
    "base.steering_law": ({}, {"flip": (1.0, 1.0)}, False, False, ("flip",)),
    "laser.mount_x": ({"x": 0.005}, {}, True, False, ("x",)),
    "laser.mount_y": ({"y": 0.005}, {}, True, False, ("y",)),
    "laser.mount_yaw": ({"yaw": 0.003}, {}, True, False, ("yaw",)),
    "laser.tilt": ({"pitch": 0.05, "roll": 0.02}, {}, True, False, ()),
    "laser.sweep": ({"stretch": 0.4}, {}, True, False, ("stretch",)),
    "laser.latency": ({"delay": 0.02}, {}, True, True, ("delay",)),
    "laser.clock_skew": ({"skew": 0.0007}, {}, True, False, ("skew",)),
    "laser.offset": ({"offset": 0.0008}, {}, True, False, ("offset",)),
    "laser.scale": ({"scale": 0.0006}, {}, True, True, ("scale",)),
    "laser.quadratic": ({"quadratic": 0.0003}, {}, True, False, ("quadratic",)),
    "laser.warmup": ({"amplitude": 0.002}, {"tau": (60, 250)}, True, True, ("amplitude", "tau")),
    "laser.temperature": ({"coefficient": 0.0003}, {}, True, False, ("coefficient",)),
    "laser.cyclic": ({"amplitude": 0.001}, WAVE, False, True, ("amplitude", "wavelength")),
    "laser.incidence_bias": ({"k": 0.0008}, {}, True, True, ()),
    "laser.reflectance": ({"bias": 0.002}, {}, True, False, ()),
    "laser.beam_bias": ({"sd": 0.0008}, {"seed": (1, 1e6)}, False, False, ("sd",)),
    "laser.range_noise": ({"share": 0.15}, {}, False, True, ("share",)),
    "laser.incidence_noise": ({"gain": 0.1}, {}, False, True, ()),
    "laser.beam_correlation": ({"rho": 0.2}, {}, False, True, ("rho",)),
    "laser.heavy_tails": ({"inverse_nu": 0.15}, {}, False, False, ("inverse_nu",)),
    "laser.mixed_pixels": ({"probability": 0.1}, {}, False, True, ()),
    "laser.saturation": ({"cut": 0.03}, {}, False, True, ("cut",)),
    "laser.crosstalk": ({"probability": 0.1}, BURST, False, True, ()),
    "laser.quantisation": ({}, {"step": (0.002, 0.002)}, False, True, ("step",)),
    "world.map_error": ({"sd": 0.003}, {"seed": (1, 1e6)}, False, True, ("sd",)),
}  # fmt: skip
ONE_SIDED = {i for i, row in TABLE.items() if not row[2]} - {"base.lateral_slip"}
TWINS = ["base.cross_w_to_v", "base.marker_y"]  # a point beside base_link moves as if turning moved the chair forward
# what is confounded in which drives
MODES = {
    "one_speed": ["base.gain_v", "base.dac_zero_f", "base.dead_zone_v", "base.curvature_v"],
    "left": ["base.gain_w", "base.left_right_gain"],
    "back": ["base.gain_v", "base.reverse_gain"],
    "arc": ["base.veer", "base.understeer", "base.cross_v_to_w", "base.gain_w", "base.curvature_w"],
    "one_turn": ["base.dead_zone_w", "base.gain_w", "base.curvature_w"],
    "free": TWINS,
}


@dataclass
class Plan:
    """What a recording hides."""

    causes: list[Cause]
    targets: list[float]
    mode: str = "free"
    unknown: tuple[str, list[str], str] | None = None
    wrong: int = -1
    column: str = ""
    dark: bool = False
    scans: bool = False


def cause(rng: np.random.Generator, name: str, form: str = "plain") -> Cause:
    """One of the catalogue, of about its usual size."""
    sized, fixed, signed, _, _ = TABLE[name]
    sign = float(rng.choice([-1, 1])) if signed else 1.0
    p = {k: sign * x * (rng.uniform(-1, 1) if k in ("climb_y", "roll") else 1.0) for k, x in sized.items()}
    p.update({k: float(rng.uniform(*r)) for k, r in fixed.items()})
    if name == "base.accel_limit":
        p = {k: x * rng.uniform(0.7, 1.3) for k, x in p.items()}
    return Cause(name, p, tuple(sized), form)


def pick(names: list[str], kind: str, number: int) -> str:
    """The names in turn, in an order that the kind decides."""
    order = np.random.default_rng(KINDS.index(kind) + 77).permutation(len(names))
    return names[int(order[number % len(names)])]


def plan(rng: np.random.Generator, kind: str, seed: int, attempt: int) -> Plan:
    """What to hide; later attempts take something else."""
    later = 0 if attempt < 3 else attempt * 5
    base = [i for i in TABLE if i.startswith("base") and i not in TWINS]
    lasers = [i for i in TABLE if not i.startswith("base")]
    small = [i for i in base if i != "base.steering_law"]
    out = Plan([], [], scans=bool(rng.random() < 0.25))
    number, form = seed // 3 * 2 + seed % 3 + later, "plain"
    if kind in ("single", "form"):
        group = lasers if seed % 3 == 2 else small
        number = seed // 3 + later if seed % 3 == 2 else number
        if kind == "form":
            group, form = [i for i in group if TABLE[i][3]], "other"
        out.causes = [cause(rng, pick(group, kind, number), form)]
    elif kind in ("pair", "triple"):
        names = base + lasers
        first = pick(names, kind, seed + later)
        n = 2 if kind == "pair" else 3
        rest = rng.permutation([i for i in names if i != first])[: n - 1].tolist()
        out.causes = [cause(rng, str(i)) for i in [first, *rest]]
    elif kind == "unknown":
        name, size, more, channel, follows, note = UNKNOWN[(seed + later) % len(UNKNOWN)]
        p = {"a": size * float(rng.choice([-1, 1]) if channel in ("range", "lateral", "w") else 1.0)}
        p.update({k: float(rng.uniform(*r)) for k, r in more.items()})
        out.causes = [Cause(name, p, ("a",), "other")]
        out.column = next((f for f in follows if f in ("lean", "lamp", "wind", "tyre_pressure")), "")
        out.unknown = (channel, list(follows), note)
    elif kind == "confounded":
        out.scans, out.mode = False, list(MODES)[(seed + later) % len(MODES)]
        c = cause(rng, str(rng.choice(MODES[out.mode])))
        out.causes = [Cause(c.id, {k: -abs(x) if "gain" in k or "offset" in k else x for k, x in c.p.items()}, c.keys)]
    elif kind == "wrong":
        out.wrong = seed
    high = {"pair": 50.0, "triple": 45.0}.get(kind, 48.0)
    out.targets = [float(np.exp(rng.uniform(np.log(16), np.log(high)))) for _ in out.causes]
    ids = [c.id for c in out.causes]
    out.scans |= any(not is_base(c) for c in out.causes)
    out.dark = "laser.reflectance" in ids or bool(rng.random() < 0.2)
    if "laser.temperature" in ids:
        out.column = "temperature"
    return out


def is_base(c: Cause) -> bool:
    """Tell whether it shows in the reference rather than in the readings."""
    return c.id.startswith(("base.", "odd."))


def told(c: Cause) -> dict[str, float]:
    """The parameters that mean the same as in the catalogue."""
    if c.form != "plain" or c.id not in TABLE:
        return {}
    if c.id == "laser.saturation":
        return {"inverse_far": round(1 / (4.0 - c.p["cut"]), 6)}
    return {k: round(c.p[k], 6) for k in TABLE[c.id][4]}


@dataclass
class Group:
    """One rival: its causes are fitted together."""

    id: str
    causes: list[Cause] = field(default_factory=list)


def rivals() -> list[Group]:
    """The base effects of the catalogue, each at a small size, for linearised signals."""
    groups = []
    for name, (sized, fixed, _, _, _) in TABLE.items():
        if not name.startswith("base") or name in ("base.dac_quantisation", "base.steering_law"):
            continue
        extra = {k: 0.5 * (a + b) for k, (a, b) in fixed.items()}
        if name in ("base.slope", "base.accel_limit"):
            groups.append(Group(name, [Cause(name, {**dict.fromkeys(sized, 0.0), k: x}, ()) for k, x in sized.items()]))
        elif name == "base.payload":
            groups.append(
                Group(
                    name, [Cause(name, {"droop": 0.05, "tau": 1e-4}, ()), Cause(name, {"droop": 0.0, "tau": 0.1}, ())]
                )
            )
        elif name == "base.saturation":
            groups += [Group(name, [Cause(name, {f"inverse_{u}": x}, ())]) for u in "vw" for x in (1.5, 1.9, 2.5)]
        else:
            groups.append(Group(name, [Cause(name, {**sized, **extra}, ())]))
    return groups
