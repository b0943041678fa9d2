# SPDX-License-Identifier: BSD-3-Clause
"""Draws causes and a world for them until they show strongly enough."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.loess.base_effects import BASE
from kurumaisu.bench.strangers.loess.case import Case, drive_about
from kurumaisu.bench.strangers.loess.laser_effects import LASER
from kurumaisu.bench.strangers.loess.lasers import draw_laser
from kurumaisu.bench.strangers.loess.pose_effects import POSE
from kurumaisu.bench.strangers.loess.robots import Robot, draw_robot
from kurumaisu.bench.strangers.loess.rooms import draw_room
from kurumaisu.bench.strangers.loess.scatter_effects import SPOIL, SPREAD
from kurumaisu.bench.strangers.loess.sensing import GEOMETRY
from kurumaisu.bench.strangers.loess.strength import Judge, left_over
from kurumaisu.bench.strangers.loess.unknown_rates import UNKNOWN_RATES
from kurumaisu.bench.strangers.loess.values import Array, Hidden, Truth

EFFECTS = {**BASE, **UNKNOWN_RATES, **POSE, **LASER, **SPREAD, **SPOIL}
SIZES = {
    **{name: (e.low, e.high, e.signed) for name, e in EFFECTS.items()},
    **{name: (low, high, name != "laser.sweep") for name, (low, high, _) in GEOMETRY.items()},
    "base.clock_scale": (0.0015, 0.005, True),
}
POSITIVE = ("laser.tilt", "laser.latency", "world.map_error")
KNOWN = sorted(name for name in SIZES if not name.startswith("unknown"))
STRANGE = sorted(name for name in SIZES if name.startswith("unknown"))
TOGETHER = ("laser.common_mode", "laser.beam_correlation")
BLIND = {
    "one_speed": ("base.gain_v", "base.curvature_v", "base.dead_zone_v"),
    "one_turn": ("base.gain_w", "base.curvature_w", "base.dead_zone_w"),
    "one_side": ("base.gain_w", "base.left_right_gain"),
    "carousel": ("base.understeer", "base.gain_w"),
}


@dataclass(frozen=True)
class Demand:
    """What a kind asks for: how many causes, from where, and how strong beside others."""

    number: int
    names: list[str]
    beside: float
    other: bool | None = None


DEMANDS = {
    "single": Demand(1, KNOWN, 6.0),
    "form": Demand(1, KNOWN, 6.0, True),
    "pair": Demand(2, KNOWN, 4.0),
    "triple": Demand(3, KNOWN, 4.0),
    "unknown": Demand(1, STRANGE, 6.0, False),
    "confounded": Demand(1, KNOWN, 0.0, False),
}


def of_laser(name: str) -> bool:
    """Whether something is hidden in the laser or the map, not in the base."""
    known = name.startswith(("laser.", "world."))
    return known or (name in EFFECTS and EFFECTS[name].channel.startswith("laser"))


def _fits(robot: Robot, names: list[str]) -> bool:
    if "base.steering_law" in names:
        return robot.law == "published"
    volts = any(name in EFFECTS and EFFECTS[name].voltages for name in names)
    return robot.law == "corrected" if volts else True


def _names(demand: Demand, rng: np.random.Generator) -> list[str]:
    while True:
        names = [str(n) for n in rng.choice(demand.names, demand.number, replace=False)]
        volts = [n for n in names if n in EFFECTS and EFFECTS[n].voltages]
        if "base.steering_law" not in names or len(volts) == 1:
            return names


def draw_world(names: list[str], style: str, rng: np.random.Generator) -> Case:
    """A robot, perhaps a laser, a room, and drives in which nothing is hidden."""
    while True:
        robot = draw_robot(rng)
        if "base.steering_law" in names and robot.law:
            robot = replace(robot, law="published")
        if _fits(robot, names):
            break
    if style != "usual":
        robot = replace(robot, person=False)
    laser = draw_laser(rng)
    sees = any(of_laser(n) for n in names) or rng.random() < 0.7
    dark = "laser.reflectance" in names or rng.random() < 0.35
    case = Case(robot, laser if sees else None, draw_room(rng, dark), style, [], [])
    case.drives = drive_about(case, [], int(rng.integers(3, 5)), rng)
    return case


def _hide(names: list[str], other: bool | None, rng: np.random.Generator) -> list[Hidden]:
    hidden = []
    for name in names:
        low, high, signed = SIZES[name]
        size = low * (high / low) ** rng.random()
        sign = float(rng.choice([-1, 1])) if signed and name not in POSITIVE else 1.0
        soft = bool(rng.random() < 0.3) if other is None else other
        hidden.append(Hidden(name, size * sign, soft, float(rng.uniform(0.02, 0.98))))
    return hidden


def _rivals(judge: Judge, hidden: Hidden) -> list[Array]:
    pool = [*LASER, *GEOMETRY, *SPREAD] if of_laser(hidden.id) else [*BASE, "base.clock_scale"]
    law, found = judge.case.robot.law, []
    for name in [*pool, "base.marker_x", "base.marker_y", "base.marker_yaw"]:
        volts = name in EFFECTS and EFFECTS[name].voltages
        fit = not volts or (law == "published" if name == "base.steering_law" else law == "corrected")
        if name != hidden.id and not name.startswith("unknown") and name not in TOGETHER and fit:
            low, high, _ = SIZES[name]
            found.append(judge.vector(Hidden(name, (low + high) / 2), [], _sees(hidden)))
    return [v for v in found if np.linalg.norm(v) > 0.1]


def _sees(hidden: Hidden) -> bool:
    return of_laser(hidden.id) or hidden.id in POSE


def weigh(case: Case, hidden: list[Hidden]) -> list[Truth]:
    """How strongly each of the hidden shows in the training drives of a case."""
    judge, found = Judge(case), []
    for h in hidden:
        rest = [o for o in hidden if o is not h]
        if h.id in SPOIL:
            z = judge.spoilt(h)
            found.append(Truth(h, z, 0.85 * z))
        elif h.id in TOGETHER:
            z = judge.correlated(h)
            found.append(Truth(h, z, 0.95 * z))
        else:
            vector = judge.vector(h, rest, _sees(h))
            z = float(np.linalg.norm(vector))
            beside = [judge.vector(o, [p for p in hidden if p is not o], _sees(h)) for o in rest if o.id not in SPOIL]
            least = min((left_over(vector, [*beside, r]) for r in _rivals(judge, h)), default=z) if z > 8 else 0.0
            found.append(Truth(h, z, min(least, left_over(vector, beside)), vector))
    return found


def _enough(found: list[Truth], beside: float, more: float) -> bool:
    return all(f.z >= 10 * more and f.beside >= beside * more for f in found)


def _tamed(found: list[Truth], rng: np.random.Generator) -> list[Hidden]:
    """The hidden with sizes that are less plain where they are very plain."""
    tamed = []
    for f in found:
        share = min(1.0, float(rng.uniform(25, 90)) / f.z)
        least = 0.7 * SIZES[f.hidden.id][0] / abs(f.hidden.size)
        tamed.append(replace(f.hidden, size=f.hidden.size * min(1.0, max(share, least))))
    return tamed


def _draw_names(kind: str, rng: np.random.Generator) -> tuple[list[str], str]:
    if kind == "confounded":
        style = str(rng.choice(sorted(BLIND)))
        return [str(rng.choice(BLIND[style]))], style
    return _names(DEMANDS[kind], rng), "usual"


def draw_case(kind: str, rng: np.random.Generator) -> tuple[Case, list[Truth]]:
    """A case of a kind that is strong enough, with what is said of its causes."""
    demand = DEMANDS[kind]
    for attempt in range(30):
        if attempt % 5 == 0:
            names, style = _draw_names(kind, rng)
            plain = draw_world(names, style, rng)
            hidden = _hide(names, demand.other, rng)
        elif "base.steering_law" not in names or len(names) > 1:
            grown = [h.id != "base.steering_law" for h in hidden]
            hidden = [replace(h, size=1.35 * h.size) if g else h for h, g in zip(hidden, grown, strict=True)]
        found = weigh(plain, hidden)
        if not _enough(found, demand.beside, 1.15):
            continue
        if names != ["base.steering_law"] and max(f.z for f in found) > 120 and attempt % 5 == 0:
            tamed = _tamed(found, rng)
            hidden = tamed if _enough(weigh(plain, tamed), demand.beside, 1.3) else hidden
        case = replace(plain, hidden=hidden)
        case.drives = drive_about(case, hidden, len(plain.drives), rng)
        found = weigh(case, hidden)
        if _enough(found, demand.beside, 1.0):
            return case, found
    raise RuntimeError("no draw is strong enough")
