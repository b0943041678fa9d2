# SPDX-License-Identifier: BSD-3-Clause
"""From a kind and a seed to what is hidden, drives that show it, and how clearly they do."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

import numpy as np

from kurumaisu.bench.strangers.reed import score, shine
from kurumaisu.bench.strangers.reed.base import BASE, DISCRETE
from kurumaisu.bench.strangers.reed.catalogue import CATALOGUE, draw
from kurumaisu.bench.strangers.reed.core import Array, Noise, Use
from kurumaisu.bench.strangers.reed.drive import Manner, blank, manner, plan, safe
from kurumaisu.bench.strangers.reed.laser import Fan, fan_of
from kurumaisu.bench.strangers.reed.room import Room, furnish, hall
from kurumaisu.bench.strangers.reed.score import Ride
from kurumaisu.bench.strangers.reed.unknown import UNKNOWN, unknown
from kurumaisu.bench.strangers.reed.write import stamps_of
from kurumaisu.bench.strangers.reed.wrong import WRONG

Rng = np.random.Generator
NO_SCANS = ("base.clock_scale", "base.marker_x", "base.marker_yaw")
BOTH = ("base.marker_y", "base.cross_w_to_v")
DULL: list[tuple[str, list[tuple[float, float]]]] = [
    ("base.gain_v", [(0.35, 0.0), (0.0, 0.0)]),
    ("base.left_right_gain", [(0.0, 0.4), (0.0, 0.0)]),
    ("base.reverse_gain", [(-0.3, 0.0), (-0.15, 0.0), (0.0, 0.0)]),
    ("base.curvature_w", [(0.0, -0.5), (0.0, 0.0)]),
    ("base.gain_w", [(0.0, 0.6), (0.0, 0.3), (0.0, 0.0)]),
    ("base.understeer", [(0.4, 0.3), (0.4, -0.3)]),
    ("base.cross_w_to_v", [(0.3, 0.4), (0.3, -0.3), (0.0, 0.5), (-0.2, -0.4), (0.0, 0.0)]),
    ("base.gain_w", [(0.3, 0.4)]),
    ("base.curvature_v", [(0.5, 0.0), (0.0, 0.0)]),
    ("base.dead_zone_v", [(0.25, 0.0), (0.0, 0.0)]),
    ("base.marker_y", [(0.3, 0.4), (0.0, -0.5), (-0.2, 0.3), (0.0, 0.0)]),
]


@dataclass
class Case:
    """A recording before it is written."""

    uses: list[Use]
    noise: Noise
    how: Manner
    rides: list[Ride]
    train: int
    room: Room
    fan: Fan | None
    asked: Array
    spans: Array
    z: list[float] = field(default_factory=list)
    beside: list[float] = field(default_factory=list)
    rivals: list[str] = field(default_factory=list)

    @property
    def fit(self) -> list[Ride]:
        """The drives to fit."""
        return self.rides[: self.train]


def seeded(*parts: object) -> Rng:
    """A generator that depends on its arguments alone."""
    return np.random.default_rng(zlib.crc32(repr(parts).encode()))


def names_of(kind: str, seed: int, skip: int) -> list[str]:
    """Whose turn it is: a permutation over seeds."""
    if kind in ("null", "wrong", "confounded"):
        return []
    count = {"pair": 2, "triple": 3}.get(kind, 1)
    pool = list(UNKNOWN) if kind == "unknown" else [n for n, e in CATALOGUE.items() if kind != "form" or e.second]
    if count > 1:
        pool = [n for n in pool if n not in (*NO_SCANS, *BOTH, *DISCRETE)]
    order = [str(n) for n in seeded("order", kind).permutation(pool)]
    first = (seed * count + 7 * skip) % len(order)
    return (order + order)[first : first + count]


def noise_of(rng: Rng) -> Noise:
    """A base and a reference as they are met."""
    return Noise(
        rng.uniform(0.005, 0.02),
        rng.uniform(0.015, 0.05),
        rng.uniform(0.1, 0.6),
        rng.uniform(0.001, 0.006),
        rng.uniform(0.001, 0.006),
        rng.uniform(0.0, 0.003),
    )


def _robot(rng: Rng, names: list[str]) -> tuple[str, str]:
    """A robot that can have these effects."""
    if "base.steering_law" in names:
        return "md100", "published"
    if any(CATALOGUE[n].stage == 1 for n in names if n in CATALOGUE):
        return "md100", "corrected"
    kinds = [("velocity", "corrected"), ("md100", "published"), ("md100", "corrected")]
    return kinds[int(rng.choice(3, p=[0.4, 0.25, 0.35]))]


def stage_of(kind: str, seed: int, attempt: int) -> Case:
    """Draw all but the sizes, and drive."""
    rng = seeded(kind, seed, attempt)
    names = names_of(kind, seed, attempt // 4)
    menu = None
    if kind == "confounded":
        names, menu = [DULL[seed % len(DULL)][0]], DULL[seed % len(DULL)][1]
    other = kind == "form" or (names == ["base.cross_w_to_v"] and kind == "single")
    uses = [unknown(rng, n) if n in UNKNOWN else draw(rng, n, other) for n in names]
    robot, law = _robot(rng, names)
    how, noise = manner(rng, robot, law, menu), noise_of(rng)
    lasers = [u for u in uses if u.effect.stage >= 10]
    by_chance = rng.random() < (0.5 if kind in ("null", "wrong") else 0.2)
    if kind == "wrong":
        by_chance = by_chance or WRONG[seed % len(WRONG)][1] in ("scan", "world")
    scans = bool(lasers) or (kind != "confounded" and by_chance and not set(names) & set(NO_SCANS))
    if any(u.id.startswith("reference") for u in uses):
        scans, noise.drift = False, 0.0
    scans = scans or (kind == "single" and set(names) <= set(BOTH))
    room = furnish(rng) if scans else hall(9.0 if not menu else 60.0)
    case = Case(uses, noise, how, [], 0, room, fan_of(rng) if scans else None, np.zeros(0), np.zeros((0, 2)))
    count, rate, pace, start = int(rng.integers(3, 6)), rng.uniform(5, 25), rng.uniform(0.3, 0.8), 4.0
    case.train = count - (2 if count == 5 else 1)
    for k in range(count):
        seconds = round(rng.uniform(60, 110 if scans else 140))
        drive = blank(rng, seconds, start, how, noise)
        asked = _questions(rng, case, seconds, pace) if k == count - 1 else np.zeros(0)
        stamps = stamps_of(rng, seconds, rate, asked)
        shots = np.arange(1.0, seconds - 1.0, pace) + rng.uniform(0, 0.2) if scans else np.zeros(0)
        shots = shots[np.all(np.abs(shots[:, None] - asked[None, :]) > 0.11, axis=1)]
        case.rides.append(Ride(drive, plan(rng, drive, how, room, uses), stamps, shots))
        start += seconds + round(rng.uniform(10, 60))
    return case


def _questions(rng: Rng, case: Case, seconds: float, pace: float) -> Array:
    """Times that are asked for: of scans, and beginnings and ends of motions."""
    begin = np.arange(8.0, seconds - 6.0, (seconds - 14.0) / rng.integers(9, 14))
    begin = np.round((begin + rng.uniform(0, 1, size=len(begin))) * 20) / 20
    if case.fan:
        case.asked, begin = begin[::3], np.delete(begin, slice(None, None, 3))
    case.spans = np.stack([begin, np.round((begin + rng.uniform(0.5, 3.0, size=len(begin))) * 20) / 20], axis=1)
    return np.concatenate([case.asked, case.spans.ravel()])


def strength(case: Case, lit: shine.Light | None) -> list[float]:
    """Z of each effect."""
    base = [u for u in case.uses if u.effect.stage < 10]
    white = iter(score.hidden(case.fit, base, case.noise)) if base else iter([])
    z = []
    for use in case.uses:
        own = float(np.linalg.norm(next(white))) if use.effect.stage < 10 else 0.0
        if use.id == "base.process_noise":
            own = float(np.sqrt(sum(score.growth(ride, base, case.noise) for ride in case.fit)))
        z.append(own if use.effect.stage < 10 else shine.strength(lit, use) if lit else 0.0)
    return z


def resize(case: Case, rng: Rng) -> None:
    """Bring each effect to the z that is drawn for it."""
    goal = [rng.uniform(60, 240) if u.effect.stage >= 10 else rng.uniform(15, 55) for u in case.uses]
    lit = None
    for turn in range(6):
        if case.fan and turn == 0:
            lit = shine.light(case.fit, [u for u in case.uses if u.effect.stage < 10], case.fan, case.room, case.noise)
        case.z = strength(case, lit)
        wrong = [abs(np.log(max(z, 1e-3) / g)) for z, g in zip(case.z, goal, strict=True)]
        if max(wrong, default=0.0) < 0.08:
            break
        for use, z, g in zip(case.uses, case.z, goal, strict=True):
            if use.id not in DISCRETE:
                way = np.sign(use.size)
                use.size = float(way * min(abs(use.size) * np.clip(g / max(z, 1e-3), 0.1, 6.0), use.effect.top))
    for _ in range(3):
        if all(safe(case.room, ride.drive, case.uses, ride.pose) for ride in case.rides):
            break
        for ride in case.rides:
            ride.pose = plan(rng, ride.drive, case.how, case.room, case.uses)


def judge(case: Case) -> None:
    """How clearly each shows in the end, and what no other effect of the catalogue explains of it."""
    base = [u for u in case.uses if u.effect.stage < 10]
    lit = shine.light(case.fit, base, case.fan, case.room, case.noise) if case.fan else None
    case.z = strength(case, lit)
    white = dict(zip([u.id for u in base], score.hidden(case.fit, base, case.noise), strict=True)) if base else {}
    rest = score.others(case.fit, score.candidates(case.how.robot, case.how.law), case.noise)
    if lit:
        none, tail = np.zeros(len(next(iter(rest.values())))), np.zeros(2 * lit.mask.size + 3 * len(lit.mask))
        for u in base:
            white[u.id] = np.concatenate([white[u.id], shine.vector(lit, u) if "marker" in u.id else tail])
        for name, column in rest.items():
            sees = shine.vector(lit, Use(BASE[name], BASE[name].size)) if "marker" in name else tail
            rest[name] = np.concatenate([column, sees])
        far = shine.rivals(lit, np.random.default_rng(1)) if len(base) < len(case.uses) else {}
        rest |= {name: np.concatenate([none, column]) for name, column in far.items()}
        white |= {u.id: np.concatenate([none, shine.vector(lit, u)]) for u in case.uses if u.effect.stage >= 10}
    found = score.beside(white, rest)
    for use, z in zip(case.uses, case.z, strict=True):
        least, left = found[use.id]
        whole = float(white[use.id] @ white[use.id]) < 1e-9 or use.id == "base.process_noise"
        case.beside.append(z if whole else min(least, z))
        case.rivals += [name.split("~")[0] for name, norm in left.items() if name and norm < 4.0]


def sound(case: Case, kind: str) -> bool:
    """Whether the case counts, and the chair touched nothing."""
    if not all(safe(case.room, ride.drive, case.uses, ride.pose) for ride in case.rides):
        return False
    if kind == "confounded":
        return min(case.z) >= 10 and bool(case.rivals)
    top = [260 if u.effect.stage >= 10 else 1e9 if u.id in DISCRETE else 62 for u in case.uses]
    least = 4.0 if len(case.uses) > 1 else 6.0
    return all(10 <= z <= t for z, t in zip(case.z, top, strict=True)) and min(case.beside, default=99.0) >= least


def case_of(kind: str, seed: int) -> tuple[Case, int]:
    """The first case that counts, and how often it had to be drawn."""
    for attempt in range(24):
        case = stage_of(kind, seed, attempt)
        if not case.uses:
            return case, attempt
        resize(case, seeded("goal", kind, seed, attempt))
        judge(case)
        if sound(case, kind):
            return case, attempt
    raise RuntimeError(f"no case for {kind} {seed}")
