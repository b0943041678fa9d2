# SPDX-License-Identifier: BSD-3-Clause
"""Cases by seed: what is hidden, how large, in which drives, under which noise; the same seed gives the same case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.bench.hidden import sizing
from kurumaisu.bench.hidden.base_case import Scale, draw_drives, recording
from kurumaisu.bench.hidden.base_catalogue import BASE
from kurumaisu.bench.hidden.case import Ask, Case, Known, Truth
from kurumaisu.bench.hidden.motion import Fault, Sizes, drive
from kurumaisu.bench.hidden.noise import REGIMES, draw_regime
from kurumaisu.types import FloatArray

Z_RANGE = (5.0, 60.0)
_SAME = 3.0  # a set of ids that leaves less than this z of the signal explains it
_NOISE = "base.process_noise"
_COUNT = {"null": 0, "single": 1, "pair": 2, "triple": 3}


def make_base(ask: Ask, seed: int) -> Case:
    """Return a case of the base: nothing, one id, two or three, drawn at random unless the ask names them."""
    what, where, how = (np.random.default_rng([seed, i]) for i in range(3))
    ids = ask.ids or _random_ids(_COUNT[ask.kind], what)
    regime = REGIMES[ask.regime] if ask.regime else draw_regime(how)
    drives = draw_drives(ask.design, regime, where)
    scale = Scale(drives)
    sizes: dict[str, Sizes] = {}
    heard = scale
    for name in sorted(ids, key=lambda name: name != _NOISE):  # the others are worth less beside it
        wanted = ask.z or float(np.exp(what.uniform(*np.log(Z_RANGE))))
        sizes[name] = _sizes(name, heard, ask.form, wanted, what)
        if name == _NOISE:
            heard = scale.louder(BASE[name].fault(sizes[name], ask.form))
    sizes = {name: sizes[name] for name in ids}
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


def _sizes(name: str, scale: Scale, form: str, wanted: float, rng: np.random.Generator) -> Sizes:
    hidden = BASE[name]
    sizes = hidden.draw(rng)
    if not hidden.scaled:
        return sizes
    if name == _NOISE:
        size = sizing.scaled_to(wanted, lambda size: _spread_z(scale, hidden.fault({"size": size}, form)), 1.0, 20.0)
        return {"size": size}
    return sizing.size_for(scale, lambda given: hidden.fault(given, form), sizes, hidden.most, wanted)


def _spread_z(scale: Scale, fault: Fault) -> float:
    """Return the z of a fault in the amplitude of the noise."""
    return sizing.spread_z(scale.path, scale.drives.regime, scale.growth(fault))


def _truth(ask: Ask, scale: Scale, heard: Scale, sizes: dict[str, Sizes]) -> Truth:
    """Return the truth: heard is the scale under the noise that there is, of which what hides in it has a part."""
    ids = tuple(sizes)
    parameters = {name: BASE[name].names(sizes[name]) for name in ids}
    means = [name for name in ids if name != _NOISE]
    loud = {name: _spread_z(scale, BASE[name].fault(sizes[name], ask.form)) for name in ids if name == _NOISE}
    if not means:
        return Truth(ask.kind, ids, parameters, z=sum(loud.values()), z_alone=loud, accepted=(ids,) if ids else ())
    faults = [BASE[name].fault(sizes[name], ask.form) for name in means]
    plain = [BASE[name].fault(sizes[name], "plain") for name in means]
    # All together, then each without the others, then each by its usual equation.
    signals = heard.signals([faults, *([fault] for fault in faults), *([fault] for fault in plain)])
    whole, own = signals[:, 0], signals[:, 1 : 1 + len(faults)]
    usual = {"usual": signals[:, 1 + len(faults) :]}
    rivals = sizing.rival_columns(heard, [name for name in sizing.RIVALS if name not in ids])
    left = _left(whole, own, rivals)
    nearest = min(left, key=lambda name: left[name])
    also = {"base.saturation": sizing.left_by_clips(heard, whole)} if ask.kind == "confounded" else {}
    return Truth(
        ask.kind,
        ids,
        parameters,
        z=float(np.linalg.norm(whole)),
        z_alone=_alone(means, own) | loud,
        z_rival=left[nearest],
        rival=nearest,
        z_form=sizing.left_beside(whole, usual)["usual"],
        accepted=_accepted(ids, left | also),
    )


def _left(whole: FloatArray, own: FloatArray, rivals: dict[str, FloatArray]) -> dict[str, float]:
    """Return what a rival leaves of the signal in the place of whichever one of the hidden ids it replaces best."""
    left = {}
    for name, column in rivals.items():
        instead = [np.column_stack([np.delete(own, i, axis=1), column]) for i in range(own.shape[1])]
        left[name] = min(sizing.left_beside(whole, {"": columns}).get("", np.inf) for columns in instead)
    return left


def _alone(names: Sequence[str], own: FloatArray) -> dict[str, float]:
    """Return what is left of each signal beside the others."""
    if len(names) == 1:
        return {names[0]: float(np.linalg.norm(own))}
    others = [np.delete(own, i, axis=1) for i in range(len(names))]
    return {name: sizing.left_beside(own[:, i], {"": others[i]})[""] for i, name in enumerate(names)}


def _accepted(ids: tuple[str, ...], left: dict[str, float]) -> tuple[tuple[str, ...], ...]:
    """Return the truth, and for a single id those rivals that leave nothing that could be seen."""
    if len(ids) > 1 or not BASE[ids[0]].scaled:
        return (ids,)
    return (ids, *((name,) for name, rest in left.items() if rest < _SAME))
