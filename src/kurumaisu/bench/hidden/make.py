# SPDX-License-Identifier: BSD-3-Clause
"""One door to all cases: by kind, ids and seed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.hidden.base.cases import make_base
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.confounded import CONFOUNDED
from kurumaisu.bench.hidden.contradictions import WRONG, spoilt
from kurumaisu.bench.hidden.generator.case import KINDS, Ask, Case, Truth
from kurumaisu.bench.hidden.generator.rooms import draw_room, world_text
from kurumaisu.bench.hidden.laser.cases import make_laser
from kurumaisu.bench.hidden.laser.catalogue import LASER
from kurumaisu.bench.hidden.unknown.cases import make_unknown_base, make_unknown_laser
from kurumaisu.bench.hidden.unknown.forms import UNKNOWN_BASE, UNKNOWN_LASER
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.whole_files import write_whole


def make(ask: Ask, seed: int, folder: Path | None = None) -> Case:
    """Return the case of a seed; folder: where a laser's world file goes, needed for those.

    Raise Error for a kind or a name that does not exist, and for a laser without a folder.
    """
    _check(ask)
    what = np.random.default_rng([seed, 40])
    if ask.kind == "wrong":
        return _make_wrong(ask, seed, folder, what)
    if ask.kind == "unknown":
        laser = ask.ids[0] in UNKNOWN_LASER if ask.ids else ask.family == "laser"
        return make_unknown_laser(ask, seed, _given(folder, ask)) if laser else make_unknown_base(ask, seed)
    if ask.kind == "confounded":
        ask = _confounded(ask, what)
    if all(name in BASE for name in ask.ids) and (ask.ids or ask.family == "base"):
        return make_base(ask, seed)
    return make_laser(ask, seed, _given(folder, ask))


def names_of(kind: str, family: str) -> tuple[str, ...]:
    """Return what can be hidden in cases of a kind, of the base or of the laser."""
    if kind == "wrong":
        return tuple(name for name, wrong in WRONG.items() if wrong.laser == (family == "laser"))
    if kind == "unknown":
        return tuple(UNKNOWN_LASER if family == "laser" else UNKNOWN_BASE)
    if kind == "confounded":
        return tuple(dict.fromkeys(name for name, _ in CONFOUNDED if (name in BASE) == (family == "base")))
    return tuple(LASER if family == "laser" else BASE)


def _check(ask: Ask) -> None:
    if ask.kind not in KINDS:
        raise Error(f"hidden: kind: {ask.kind!r} is none of {', '.join(KINDS)}")
    there = [*names_of(ask.kind, "base"), *names_of(ask.kind, "laser")]
    for name in ask.ids:
        if name not in there:
            raise Error(f"hidden: {name!r} cannot be hidden in a case of kind {ask.kind!r}; {hint(name, there)}")
    if len({name in BASE for name in ask.ids}) > 1 and ask.kind in ("pair", "triple"):
        raise Error(f"hidden: {', '.join(ask.ids)}: are not all of the base or all of the laser")


def _given(folder: Path | None, ask: Ask) -> Path:
    if folder is None:
        raise Error(f"hidden: {', '.join(ask.ids) or 'a laser'}: needs a folder for its world file")
    return folder


def _confounded(ask: Ask, rng: np.random.Generator) -> Ask:
    """Return the ask with an id and a design that hides it, of those there are for what is asked."""
    fit = [
        (name, design)
        for name, design in CONFOUNDED
        if (name in ask.ids if ask.ids else (name in BASE) == (ask.family == "base")) and ask.design in (None, design)
    ]
    if not fit:
        raise Error(f"hidden: design: {ask.design!r} hides nothing of {', '.join(ask.ids) or ask.family}")
    name, design = fit[rng.integers(len(fit))]
    return replace(ask, ids=(name,), design=design, form="plain")


def _make_wrong(ask: Ask, seed: int, folder: Path | None, rng: np.random.Generator) -> Case:
    names = names_of("wrong", ask.family)
    name = ask.ids[0] if ask.ids else str(names[rng.integers(len(names))])
    wrong = WRONG[name]
    good = replace(ask, kind="null", ids=())
    right = make_laser(good, seed, _given(folder, ask)) if wrong.laser else make_base(good, seed)
    found = spoilt(right.null, name, rng)
    if name == "wrong map":
        other = _given(folder, ask) / f"hidden_{seed}_wrong.world"
        write_whole({other: world_text("another room", draw_room(np.random.default_rng([seed, 41])))})
        found = replace(found, world=other)
    truth = Truth("wrong", problem=name, background=right.truth.background)
    return Case(found, right.null, truth, seed)
