# SPDX-License-Identifier: BSD-3-Clause
"""What each kind of recording hides, in which setting."""

from dataclasses import dataclass, field, replace

import numpy as np

from kurumaisu.bench.strangers.moor.base_laws import BASE, FORMS, UNKNOWN
from kurumaisu.bench.strangers.moor.drives import Style
from kurumaisu.bench.strangers.moor.laser import Lens
from kurumaisu.bench.strangers.moor.laser_laws import LASER, LASER_FORMS, LASER_UNKNOWN
from kurumaisu.bench.strangers.moor.motion import Law
from kurumaisu.bench.strangers.moor.wrongs import WRONGS

STEPS = Style(slew=50.0, free_form=0.0)
AHEAD = (0.1, 0.2, 0.2, 0.5, 0.0, 0.0)
CONFOUNDED: list[tuple[str, tuple[str, ...], Style]] = [
    ("base.gain_v", ("base.curvature_v",), replace(STEPS, speeds=(0.4,), weights=AHEAD)),
    ("base.gain_w", ("base.curvature_w",), replace(STEPS, turns=(0.4,))),
    ("base.left_right_gain", ("base.gain_w",), replace(STEPS, left_only=True)),
    ("base.reverse_gain", ("base.gain_v",), replace(STEPS, weights=(0.1, 0.3, 0.0, 0.0, 0.2, 0.4))),
    (
        "laser.latency",
        ("laser.mount_yaw", "base.marker_yaw"),
        replace(STEPS, turns=(0.45,), left_only=True, spin_only=True),
    ),
    (
        "laser.mount_yaw",
        ("laser.latency", "base.marker_yaw"),
        replace(STEPS, turns=(0.6,), left_only=True, spin_only=True),
    ),
]
NO_SCANS = {law.name for law in BASE if not law.scans}


@dataclass
class Choice:
    """What is to be hidden, rivals that cannot be told from it, what is wrong, how one drives."""

    base: list[Law] = field(default_factory=list)
    laser: list[Lens] = field(default_factory=list)
    rivals: tuple[str, ...] = ()
    wrong: int = -1
    volts: bool = False
    scans: bool = False
    style: Style = field(default_factory=Style)


def deal(seed: int, n: int, salt: int) -> int:
    """One of n, each once in n seeds that follow each other."""
    return int(np.random.default_rng([salt, seed // n]).permutation(n)[seed % n])


def habit(rng: np.random.Generator) -> Style:
    """How somebody drives in this recording; sometimes dull."""
    style = Style(rate=float(rng.choice([10, 15, 20, 30, 50])), slew=float(rng.choice([0.8, 1.5, 3.0, 50.0])))
    if rng.random() < 0.2:
        speeds, turns = (0.25, 0.5), (0.3, 0.6)
        return replace(style, speeds=speeds, turns=turns, weights=(0.2, 0.2, 0.25, 0.25, 0.05, 0.05))
    return replace(style, free_form=float(rng.uniform(0, 0.9)))


def pick(seed: int, kind: str, rng: np.random.Generator) -> tuple[list[Law], list[Lens]]:
    """The effects of a kind that hides some of the catalogue."""
    everything: list[Law | Lens] = [*BASE, *LASER] if kind != "form" else [*FORMS, *LASER_FORMS]
    everything.sort(key=lambda one: one.name)
    chosen = [everything[deal(seed, len(everything), {"single": 1, "form": 2, "pair": 3, "triple": 4}[kind])]]
    both = kind == "triple" and seed % 2 == 0
    while len(chosen) < {"pair": 2, "triple": 3}.get(kind, 1):
        more = everything[int(rng.integers(len(everything)))]
        names = [c.name for c in chosen] + [more.name]
        sides = {isinstance(c, Law) for c in chosen}
        lone = {"base.steering_law", "base.process_noise", "laser.quantisation", "laser.saturation"} & set(names)
        clash = (
            len(set(names)) < len(names) or lone or (NO_SCANS & set(names) and not all(n[:4] == "base" for n in names))
        )
        volts = any(isinstance(c, Law) and c.volts for c in [*chosen, more]) and set(names) & NO_SCANS
        if lone & {chosen[0].name} or (both and chosen[0].name in NO_SCANS):
            chosen = [everything[int(rng.integers(len(everything)))]]
        elif not clash and not volts and not (both and len(chosen) == 2 and sides == {isinstance(more, Law)}):
            chosen.append(more)
    return [c for c in chosen if isinstance(c, Law)], [c for c in chosen if isinstance(c, Lens)]


def choose(kind: str, seed: int, attempt: int) -> Choice:
    """Draw what a recording hides; another attempt keeps the effects of the first but for pairs and triples."""
    rng = np.random.default_rng([seed, 11, attempt])
    fate = np.random.default_rng([seed, 12])
    c = Choice(volts=bool(fate.random() < 0.5), scans=bool(fate.random() < 0.5), style=habit(rng))
    if kind in ("single", "form", "pair", "triple"):
        c.base, c.laser = pick(seed, kind, rng)
    elif kind == "unknown":
        both: list[Law | Lens] = [*UNKNOWN, *LASER_UNKNOWN]
        one = both[deal(seed, len(both), 5)]
        c.base, c.laser = ([one], []) if isinstance(one, Law) else ([], [one])
    elif kind == "confounded":
        name, c.rivals, style = CONFOUNDED[deal(seed, len(CONFOUNDED), 6)]
        c.base = [law for law in BASE if law.name == name]
        c.laser = [lens for lens in LASER if lens.name == name]
        c.style = replace(style, rate=c.style.rate)
    elif kind == "wrong":
        c.wrong = deal(seed, len(WRONGS), 7)
        c.scans = c.scans or WRONGS[c.wrong].scans
        c.volts = c.volts if WRONGS[c.wrong].volts is None else bool(WRONGS[c.wrong].volts)
    c.scans = bool(c.laser) or (c.scans and all(law.scans for law in c.base))
    c.volts = c.volts or any(law.volts for law in c.base)
    return c
