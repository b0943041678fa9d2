# SPDX-License-Identifier: BSD-3-Clause
"""Here it is decided what changes how readings scatter, and whether that matters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.heldout.materiality import MATERIAL
from kurumaisu.critic.ranges.noise.scan_noise import NoiseLikelihood, common_mode
from kurumaisu.critic.ranges.scans.beams import Shots, hits_of, with_own
from kurumaisu.critic.ranges.scans.valid_readings import usable_beams
from kurumaisu.critic.ranges.search import block_evidence
from kurumaisu.critic.ranges.search.mean_effects import MeanEffects
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import ParameterFit
from kurumaisu.critic.scatter.common_offset import beyond_own_offset, with_common_offset
from kurumaisu.critic.scatter.curves import ScatterCurve, ScatterCurves
from kurumaisu.critic.scatter.scatter_fit import ScatterFit
from kurumaisu.critic.scatter.scatter_search import ScatterEffect, ScatterSearch
from kurumaisu.critic.scatter.simulation import ScatterSimulator
from kurumaisu.critic.scatter.statistics import Statistics
from kurumaisu.critic.values.policy import FORM_ERROR, NAMED, RIVAL
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.story import Comparison
from kurumaisu.params import EffectSetting

# Share of what single readings scatter by, from which it matters that whole scans are off together: what neighbours
# have in common beyond the simplest equation for it moves the mean of a scan as well.
_HEARD = 0.06
_STRAY = 2e-4  # share of readings elsewhere, below which nobody minds: one of each seven scans of a URG-04LX


@dataclass(frozen=True)
class MeanFit:
    """What acts on the mean readings of some scans, in their noise, and its fit by simulation."""

    assembly: Assembly
    normal: NormalEquations
    made: MeanEffects
    fit: ParameterFit

    @cached_property
    def noise_likelihood(self) -> NoiseLikelihood:
        """How likely the noise of scans is beside all that acts."""
        return self.fit.assembly.noise_beside(self.fit.normal.beam_noise, self.made.fit.forms, self.fit.block)


@dataclass(frozen=True)
class Scatter:
    """What acts on how readings scatter: effects; curves in no catalogue, the likeliest first; what they mend.

    slight: effects that take away or make wrong so few readings that nobody minds.
    """

    effects: list[ScatterEffect]
    curves: list[ScatterCurve]
    comparisons: tuple[Comparison, ...]
    slight: frozenset[str] = frozenset()


def scatter_effects(mean: MeanFit, recording: Recording, ids: frozenset[str] | None, own: float) -> Scatter:
    """Return what acts on how readings scatter, effects on whole scans among it.

    own: the sd [m] of whole scans in the model.
    """
    assembly, made, fit = mean.assembly, mean.made, mean.fit
    if fit.assembly.map_change.readings.any():  # how far others scatter by it, nobody can say
        return Scatter([], [], ())
    away = 0.0 if made.winner is None else block_evidence.wall_error(made.winner, mean.normal.gram)
    found = _of_readings(assembly, fit, ids, strange=made.curve, away=away)
    if made.curve:
        return found
    seen = common_mode(mean.noise_likelihood, recording.truth, fit.normal.scan_noise, own)
    seen = replace(seen, wary=fit.normal.wary)
    scatter = with_common_offset(found.effects, seen, fit.normal.scan_noise, recording, ids)
    scatter = beyond_own_offset(scatter, FORM_ERROR * _spread_of(assembly, mean.normal, made), own)
    return replace(found, effects=scatter)


def material(scatter: Scatter, normal: NormalEquations, own: float) -> list[ScatterEffect]:
    """Return the effects that matter beside what single readings scatter by; own as above."""
    heard = [each for each in scatter.effects if each.setting.id not in scatter.slight]
    return beyond_own_offset(heard, _HEARD * float(np.median(normal.beam_noise.sd[normal.beam_noise.valid])), own)


def _of_readings(
    assembly: Assembly, fit: ParameterFit, ids: frozenset[str] | None, *, strange: bool, away: float
) -> Scatter:
    """Return what acts on how readings scatter about the best fit of their mean.

    strange: something that is in no catalogue acts on the mean. A curve misses steps and edges of it, nobody can say
    how far, so that errors about it say nothing of scatter. away [m]: by how far ends of walls may be elsewhere.
    """
    rows = fit.assembly.smooth_rows()
    few = fit.assembly.thinned(rows)
    few.geometry &= usable_beams(few.shots, few.marks.seen, few.marks.base, away)
    if not few.geometry.any():  # with walls that far off, no beam is surely away from their ends
        return Scatter([], [], ())
    statistics = Statistics(few, fit.normal.scan_noise)
    means = {f"{form.id}.{column.parameter.name}" for form in assembly.forms for column in form.columns}
    means |= {f"{form.id}.{name}" for form in assembly.forms for name in form.at}
    measured = few.shots.measured
    error = np.where(np.isfinite(measured), fit.left[rows], np.nan)
    seen = statistics.of(measured, error)
    walls = [few.marks.seen]  # what beams may meet: stairs are finer than errors of poses, and scatter readings farther
    if few.shots.walls.drawn is not None:
        walls.append(hits_of(replace(few.shots, walls=few.shots.walls.drawn), (), 0, like=few.marks.seen))
    heard = ~statistics.of_errors() | (not strange)

    def searched(shots: Shots, curve: float = 0.0) -> tuple[ScatterSimulator, ScatterSearch, list[ScatterEffect]]:
        tried = [ScatterSimulator(shots, few.marks, statistics, fit.missed[rows], met) for met in walls]
        fits = [ScatterFit(simulate, seen, sorted(means), ids, heard) for simulate in tried]
        likeliest = int(np.argmin([one.likeness.cost(one.likeness.offset) for one in fits]))
        search = ScatterSearch(fits[likeliest], curve)
        return tried[likeliest], search, search.run()

    simulate, search, found = searched(few.shots)
    known = ScatterCurves(few, statistics, simulate, error)
    asked = not strange and (ids is None or effects.SMOOTH in ids)
    curves = known.run([each.setting for each in found]) if asked else []
    if curves:  # what was taken for it in the catalogue need not act
        _, search, found = searched(with_own(few.shots, curves[0].setting), curves[0].nats)
    for one in found if curves else ():
        if _stage(one.setting) != _stage(curves[0].setting):
            continue
        level = known.alone(curves[0], [each.setting for each in found if each is not one])
        _, other, fewer = searched(with_own(few.shots, level.setting), level.nats)
        if len(fewer) < len(found):
            curves, search, found = [level, *curves[1:]], other, fewer
            break
    compared = (search.compared(statistics.names(), [each.setting for each in found]),) if found else ()
    touched = ((each.setting.id, *simulate.touched(each.setting)) for each in found)
    slight = frozenset(name for name, lost, moved in touched if lost < MATERIAL and moved < _STRAY)
    return Scatter(found, curves, compared, slight)


def _stage(setting: EffectSetting) -> effects.LaserStage | None:
    effect = effects.by_id(setting.id)
    return effect.stage if issubclass(effect, effects.LaserEffect) else None


def open_set(scatter: ScatterEffect) -> tuple[str, ...]:
    """Return the effects of which one makes readings scatter so, where it is not certain which."""
    every = {scatter.setting.id: scatter.p, **scatter.rivals}
    group = tuple(sorted(name for name, p in every.items() if p >= RIVAL or name == scatter.setting.id))
    certain = len(group) > 1 and sum(every[name] for name in group) >= NAMED
    return group if certain and scatter.p < NAMED else ()


def _spread_of(assembly: Assembly, normal: NormalEquations, made: MeanEffects) -> float:
    """Return by how much [m] what acts on the mean, by equations nearly right, moves some readings more than others.

    In the curves that some of it may follow instead no scans are off together.
    """
    valid, blocks = normal.beam_noise.valid, {free.id for free in assembly.free}
    parts = [part for part in made.parts() if part.id in blocks or effects.by_id(part.id).empirical]
    parts = [part for part in parts if part.id not in made.others]
    moved = [assembly.columns[valid][:, part.span] @ part.coefficients for part in parts]
    return float(np.std(sum(moved))) if moved else 0.0
