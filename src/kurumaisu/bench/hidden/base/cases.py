# SPDX-License-Identifier: BSD-3-Clause
"""Cases by seed: what is hidden, how large, in which drives, under which noise; the same seed gives the same case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from kurumaisu.bench.hidden.base import sizing
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import Scale, draw_drives, recording
from kurumaisu.bench.hidden.generator.case import APART, FAINTEST, Ask, Case, Known, Truth
from kurumaisu.bench.hidden.generator.motion import Fault, Sizes, drive
from kurumaisu.bench.hidden.generator.noise import REGIMES, draw_lasting, draw_regime
from kurumaisu.types import FloatArray

Z_RANGE = (FAINTEST, 60.0)
_SAME = 3.0  # a set of ids that leaves less than this z of the signal explains it
_PARTS = (1.0, 0.1)  # of a rival's typical size: a little of a lag is a delay, more of it is not
_NOISE = "base.process_noise"
_COUNT = {"null": 0, "single": 1, "pair": 2, "triple": 3}


def make_base(ask: Ask, seed: int) -> Case:
    """Return a case of the base: nothing, one id, two or three, drawn at random unless the ask names them."""
    what, where, how = (np.random.default_rng([seed, i]) for i in range(3))
    ids = ask.ids or _random_ids(_COUNT[ask.kind], what)
    regime = REGIMES[ask.regime] if ask.regime else draw_lasting(draw_regime(how), how)
    drives = draw_drives(ask.design, regime, where)
    scale = Scale(drives)
    worth = {name: ask.z or float(np.exp(what.uniform(*np.log(Z_RANGE)))) for name in ids}
    sizes = {name: BASE[name].draw(what) for name in ids}
    heard = scale
    if _NOISE in ids:  # the others are worth less beside it
        sizes[_NOISE] = _loudness(scale, ask.form, worth[_NOISE])
        heard = scale.louder(BASE[_NOISE].fault(sizes[_NOISE], ask.form))
    for name in _means(ids):
        sizes[name] = _size(name, heard, ask.form, sizes[name], worth[name])
    for name in _means(ids) if len(ids) > 1 else ():
        sizes[name] = _size_beside(name, heard, ask.form, sizes, worth[name])
    faults = [BASE[name].fault(sizes[name], ask.form) for name in ids]
    name = f"hidden {seed}"
    null = recording(name, drives, ())
    found = recording(name, drives, faults) if faults else null
    known = None
    if ids and not {_NOISE, "base.sign"} & set(ids):  # no mean, or no data that anybody would fit
        known = Known(tuple(drive(replace(s, noise=None), faults)[0] for s in drives.settings), regime)
    return Case(found, null, _truth(ask, scale, heard, sizes), seed, known)


def _random_ids(count: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Return different ids of which a size can be chosen, in the catalogue's order."""
    names = [name for name, hidden in BASE.items() if hidden.scaled]
    chosen = rng.choice(len(names), size=count, replace=False)
    return tuple(names[i] for i in sorted(chosen))


def _means(ids: Sequence[str]) -> list[str]:
    return [name for name in ids if name != _NOISE]


def _loudness(scale: Scale, form: str, wanted: float) -> Sizes:
    hidden = BASE[_NOISE]

    def worth(size: float) -> float:
        return _spread_z(scale, hidden.fault({"size": size}, form))

    return {"size": sizing.scaled_to(wanted, worth, hidden.typical, hidden.most)}


def _size(name: str, scale: Scale, form: str, sizes: Sizes, wanted: float) -> Sizes:
    """Return sizes of which the wanted z is that of what they alone do."""
    hidden = BASE[name]
    if not hidden.scaled:
        return sizes
    return sizing.size_for(scale, lambda given: hidden.fault(given, form), sizes, hidden.most, wanted)


def _size_beside(name: str, scale: Scale, form: str, sizes: dict[str, Sizes], wanted: float) -> Sizes:
    """Return sizes of which the wanted z is that of what they add to the others: a slow chair has little to clip."""
    if not BASE[name].scaled:
        return sizes[name]
    names = _means(tuple(sizes))

    def worth(size: float) -> float:
        changed = sizes | {name: {**sizes[name], "size": size}}
        own = sizing.shares(scale, [BASE[other].fault(changed[other], form) for other in names])[1]
        return float(np.linalg.norm(own[:, names.index(name)]))

    return {**sizes[name], "size": sizing.scaled_to(wanted, worth, sizes[name]["size"], BASE[name].most)}


def _spread_z(scale: Scale, fault: Fault) -> float:
    """Return the z of a fault in the amplitude of the noise."""
    return sizing.spread_z(scale.path, scale.drives.regime, scale.growth(fault))


def _truth(ask: Ask, scale: Scale, heard: Scale, sizes: dict[str, Sizes]) -> Truth:
    """Return the truth: heard is the scale under the noise that there is, of which what hides in it has a part."""
    ids = tuple(sizes)
    parameters = {name: BASE[name].names(sizes[name]) for name in ids}
    means = _means(ids)
    loud = {name: _spread_z(scale, BASE[name].fault(sizes[name], ask.form)) for name in ids if name == _NOISE}
    if not means:
        return Truth(ask.kind, ids, parameters, z=sum(loud.values()), z_alone=loud, accepted=(ids,) if ids else ())
    faults = [BASE[name].fault(sizes[name], ask.form) for name in means]
    whole, own = sizing.shares(heard, faults)
    usual, usual_own = sizing.shares(heard, [BASE[name].fault(sizes[name], "plain") for name in means])
    left = _left(heard, ids, faults, own)
    nearest = min(left, key=lambda name: left[name])
    also = {"base.saturation": sizing.left_by_clips(heard, whole)} if ask.kind == "confounded" else {}
    alike = left | also if len(ids) == 1 and BASE[ids[0]].scaled else {}
    return Truth(
        ask.kind,
        ids,
        parameters,
        z=float(np.linalg.norm(whole)),
        z_alone=_alone(means, own) | loud,
        z_rival=left[nearest],
        rival=nearest,
        z_form=sizing.left_after_rivals(whole - usual, {"usual": usual_own})["usual"],
        accepted=(ids, *((name,) for name in _below(alike, _SAME))),
        near=_below(alike, APART),
    )


def _left(scale: Scale, ids: Sequence[str], faults: Sequence[Fault], own: FloatArray) -> dict[str, float]:
    """Return what a rival leaves of the signal in the place of whichever one of the hidden ids it replaces best.

    own (n, faults): what each adds to the others.
    """
    names = [name for name in sizing.RIVALS if name not in ids]
    left: dict[str, float] = {}
    for i, part in product(range(len(faults)), _PARTS):
        others = np.delete(own, i, axis=1)
        rivals = sizing.rival_columns(scale, names, [*faults[:i], *faults[i + 1 :]], part)
        beside = {name: np.column_stack([others, columns]) for name, columns in rivals.items()}
        for name, rest in sizing.left_after_rivals(own[:, i], beside).items():
            left[name] = min(rest, left.get(name, np.inf))
    return left


def _alone(names: Sequence[str], own: FloatArray) -> dict[str, float]:
    """Return what is left of each signal beside the others."""
    if len(names) == 1:
        return {names[0]: float(np.linalg.norm(own))}
    others = [np.delete(own, i, axis=1) for i in range(len(names))]
    return {name: sizing.left_after_rivals(own[:, i], {"": others[i]})[""] for i, name in enumerate(names)}


def _below(left: dict[str, float], z: float) -> tuple[str, ...]:
    """Return the rivals that leave less than a z."""
    return tuple(name for name, rest in left.items() if rest < z)
