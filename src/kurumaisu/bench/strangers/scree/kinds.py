# SPDX-License-Identifier: BSD-3-Clause
"""What is hidden in a case of each kind, and whether it is strong enough."""

from __future__ import annotations

from dataclasses import dataclass, replace

from kurumaisu.bench.strangers.scree.basics import Cause, Rng
from kurumaisu.bench.strangers.scree.catalogue import (
    ALL,
    VOLTS,
    draw_cause,
    draw_unknown,
    fit_to,
    of_laser,
)
from kurumaisu.bench.strangers.scree.driving import Manner, draw_manner
from kurumaisu.bench.strangers.scree.lasers import draw_laser
from kurumaisu.bench.strangers.scree.plant import Causes
from kurumaisu.bench.strangers.scree.ranges import Site
from kurumaisu.bench.strangers.scree.recorded import Setup, draw_columns
from kurumaisu.bench.strangers.scree.reference import draw_reference
from kurumaisu.bench.strangers.scree.robots import ROBOTS, draw_robot
from kurumaisu.bench.strangers.scree.rooms import draw_room
from kurumaisu.bench.strangers.scree.strength import Strength
from kurumaisu.bench.strangers.scree.unknowns import NATURES

KINDS = ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong")
VOLT_IDS = tuple(e.id for e in VOLTS)
ONE_SPEED = ("base.gain_v", "base.curvature_v", "base.dead_zone_v")
ONE_SIDE = ("base.gain_w", "base.left_right_gain")
WITHOUT_LASER = ("base.marker_y", "base.cross_w_to_v")


@dataclass(frozen=True)
class Wanted:
    """Which causes are hidden, in which drives, and whether there is a laser."""

    ids: tuple[str, ...]
    laser: bool
    one_speed: bool = False
    one_side: bool = False


def draw_wanted(kind: str, rng: Rng) -> Wanted:
    """The ids of what is hidden, each as likely as any other."""
    some = bool(rng.random() < 0.5)
    if kind in ("null", "wrong"):
        return Wanted((), some)
    if kind == "confounded":
        ids = (ONE_SPEED, ONE_SIDE, WITHOUT_LASER)[int(rng.integers(3))]
        one = (ids[int(rng.integers(len(ids)))],)
        return Wanted(one, some and ids is not WITHOUT_LASER, ids is ONE_SPEED, ids is ONE_SIDE)
    if kind == "unknown":
        names = list(NATURES)
        name = names[int(rng.integers(len(names)))]
        return Wanted((name,), of_laser(name) or some)
    n = {"single": 1, "form": 1, "pair": 2, "triple": 3}[kind]
    pool = [i for i in ALL if kind != "form" or i != "base.steering_law"]
    if n > 1:
        pool.remove("base.steering_law")
    chosen = [pool[k] for k in rng.permutation(len(pool))[:n].tolist()]
    some = some or any(i in WITHOUT_LASER for i in chosen)
    return Wanted(tuple(chosen), some or any(of_laser(i) for i in chosen))


def draw_setup(wanted: Wanted, rng: Rng) -> Setup:
    """A robot, a room, a reference and a laser in which the causes can be."""
    robot = draw_robot(rng)
    if any(i in VOLT_IDS for i in wanted.ids):
        robot = replace(robot, **{k: getattr(ROBOTS[0], k) for k in ("name", "kind", "v_top", "w_top", "track")})
        robot = replace(robot, radius=ROBOTS[0].radius, noise_v=ROBOTS[0].noise_v, noise_w=ROBOTS[0].noise_w)
    steered = any(i in (*VOLT_IDS, "base.dead_zone_w") for i in wanted.ids)
    published = "base.steering_law" in wanted.ids or (robot.volts and not steered and rng.random() < 0.2)
    robot = replace(robot, published=published)
    room = draw_room(rng, robot.v_top)
    if "laser.reflectance" in wanted.ids:
        dark = (0.15, 0.35)
        boxes = tuple(replace(b, bright=dark[k % 2] if k in (1, 3, 5) else b.bright) for k, b in enumerate(room.boxes))
        room = replace(room, boxes=boxes)
    site = Site(room, draw_laser(rng)) if wanted.laser else None
    manner = draw_manner(rng)
    if wanted.one_speed:
        manner = Manner(manner.period, 0.1, 0.0, one_speed=True)
    elif wanted.one_side:
        manner = replace(manner, one_side=True)
    follows = "laser.temperature" in wanted.ids
    follows |= any(i in NATURES and "column" in NATURES[i].covariates for i in wanted.ids)
    noted = follows or bool(rng.random() < 0.4)
    return Setup(robot, room, draw_reference(rng), site, manner, draw_columns(rng), noted)


def draw_causes(wanted: Wanted, setup: Setup, kind: str, grow: float, rng: Rng) -> Causes:
    """The causes with their sizes."""
    out: list[Cause] = []
    for i in wanted.ids:
        if i in NATURES:
            out.append(draw_unknown(i, grow, rng))
        else:
            other = kind == "form" or (kind in ("pair", "triple") and rng.random() < 0.3 and i != "base.steering_law")
            out.append(fit_to(draw_cause(ALL[i], other, grow, rng), setup.robot))
    order = {"base.lag_v": 1, "base.lag_w": 1, "base.accel_limit": 0, "base.payload": 1}
    return tuple(sorted(out, key=lambda c: order.get(c.id, 2)))


def enough(kind: str, found: list[Strength]) -> bool:
    """Whether a case counts."""
    beside = {"single": 6.0, "form": 6.0, "pair": 4.0, "triple": 4.0, "unknown": 5.0}.get(kind, 0.0)
    return all(s.z >= 10 and s.beside >= beside for s in found)
