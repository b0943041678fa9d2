# SPDX-License-Identifier: BSD-3-Clause
"""How strong each hidden cause is in motions and readings together, beside all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Array, Cause
from kurumaisu.bench.strangers.scree.catalogue import BASE, OF_REFERENCE, VOLTS, fit_to, of_laser
from kurumaisu.bench.strangers.scree.light import (
    View,
    mean_effects,
    mean_rivals,
    pose_effect,
    scatter_strength,
    scatters,
    view,
)
from kurumaisu.bench.strangers.scree.plant import Causes, Drive
from kurumaisu.bench.strangers.scree.ranges import Site
from kurumaisu.bench.strangers.scree.reference import Reference
from kurumaisu.bench.strangers.scree.strength import Motions, Strength, motions, worst
from kurumaisu.bench.strangers.scree.unknowns import OFFSETS


@dataclass(frozen=True)
class Scales:
    """What effects are weighed with: motions, and views of scans if there is a laser."""

    yard: Motions
    views: list[View]
    site: Site | None
    reference: Reference

    def base(self, causes: Causes) -> Array:
        """Motions and readings under causes of the base."""
        return np.concatenate([self.yard.of(causes), self._light(causes)])

    def _light(self, causes: Causes) -> Array:
        if self.site is None:
            return np.zeros(0)
        if not any(c.id in OF_REFERENCE or c.id in OFFSETS for c in causes):
            return np.zeros(sum(v.counts.size for v in self.views))
        return pose_effect(self.views, self.site, causes, self.reference)

    def laser(self, effects: list[Array]) -> list[Array]:
        """Effects on readings alone, as long as the others."""
        none = np.zeros(len(self.yard.of(())))
        return [np.concatenate([none, e]) for e in effects]


def _base_rivals(scales: Scales, all_of_them: bool, without: list[str]) -> list[Array]:
    robot = scales.yard.drives[0].robot
    entries = [e for e in BASE + (VOLTS if robot.volts else ()) if e.id not in ("base.steering_law", *without)]
    none = scales.base(())
    use = [e for e in entries if all_of_them or e.id in OF_REFERENCE]
    return [scales.base((fit_to(Cause(e.id, e.typical), robot),)) - none for e in use]


def weigh(
    drives: tuple[Drive, ...], stamps: list[Array], causes: Causes, reference: Reference, site: Site | None
) -> list[Strength]:
    """The strength of each cause in some drives."""
    views = [view(site, d, s) for d, s in zip(drives, stamps, strict=True)] if site else []
    base = tuple(c for c in causes if not of_laser(c.id))
    light = tuple(c for c in causes if of_laser(c.id) and not scatters(c))
    found: dict[str, Strength] = {}
    if site:
        found = {c.id: scatter_strength(views, site, c, reference) for c in causes if scatters(c)}
    if base or light:
        scales = Scales(motions(drives, base, reference), views, site, reference)
        full = scales.base(base)
        effects = [full - scales.base(tuple(o for o in base if o is not c)) for c in base]
        ids = [c.id for c in causes]
        rivals = _base_rivals(scales, bool(base), ids)
        if site and (light or any(c.id in OF_REFERENCE or c.id in OFFSETS for c in base)):
            effects += scales.laser(mean_effects(views, site, light, reference))
            rivals += scales.laser(mean_rivals(views, site, reference, ids))
        for c, e in zip((*base, *light), effects, strict=True):
            found[c.id] = worst(e, [o for o in effects if o is not e], rivals)
    return [found[c.id] for c in causes]
