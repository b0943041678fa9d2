# SPDX-License-Identifier: BSD-3-Clause
"""What scans lack to tell effects apart, and which scripted experiment supplies it: planned in its own world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.experiment.design import DECIDED
from kurumaisu.critic.ranges.noise.shared_errors import ScanNoise
from kurumaisu.critic.ranges.scans.beams import hits_of, predict
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.signals.effect_columns import Form
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.verdict import NextExperiment
from kurumaisu.experiments import Script, names, shipped_script
from kurumaisu.geometry import compose
from kurumaisu.params import Model, shipped
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world
from kurumaisu.world.layout import travels

_TOLD = 4.5  # [nat], a whitened norm of 3, from which one effect is told from another
_SCANS = 5  # at a place, enough for a plan
_WAY = 20.0  # [s] between two places
_REST = 5.0  # [s] of standing there before the first scan and after the last one
_LONGEST = 600.0  # [s] of an experiment that is proposed before anything is known
_TRUTH = (0.005, 0.005)  # [m, rad] of a reference as surveyed marks give it, where a recording does not say
_COMMON = (2e-4, 1.0)  # [m, s] of whole scans
_FLAT = 0.02  # [m] what the ends of beams on one wall scatter by across it
_MOVED = 0.05  # [m] between the places of a laser, at least
_DISTANCES = 1.2  # ratio of the farthest to the nearest reading, at least


def supplying_experiment(
    model: Model, wanted: Sequence[str], truth: tuple[float, float] | None
) -> NextExperiment | None:
    """Return the experiment for the laser that tells most of these effects from one another, the shorter one of two.

    truth: sd of the reference [m, rad], None where nobody knows. None where no experiment tells any.
    """
    options = []
    for script in map(shipped_script, names()):
        if script.kind == "places" and script.seconds <= _LONGEST:
            nats = _distinguishable(_planned(script, model, frozenset(wanted), truth or _TRUTH), wanted)
            told = tuple(name for name, each in zip(wanted, nats, strict=True) if each.min() >= _TOLD)
            expected = float(np.minimum(nats, DECIDED).mean())
            options.append((len(told), -script.seconds, NextExperiment(script.name, script.seconds, expected, told)))
    best = max(options, key=lambda option: option[:2], default=None)
    return best[2] if best is not None and best[0] else None


def every_id() -> tuple[str, ...]:
    """Return the effects on the mean readings and on the map that chairs at rest can show."""
    return tuple(effect.id for effect in (*effects.LASER, *effects.WORLD))


def _planned(
    script: Script, model: Model, wanted: frozenset[str], truth: tuple[float, float]
) -> tuple[list[Form], FloatArray]:
    """Return the forms of effects, and the products of their columns in the noise of scans at a script's places."""
    path = shipped(f"worlds/{script.world}")
    world = load_world(path)
    start = next(world.poses[each.index] for each in world.models if travels(each, world.models))
    begins = np.cumsum([0.0, *(each.seconds + _WAY for each in script.places[:-1])])
    ends = begins + [each.seconds for each in script.places]
    poses = np.array([compose(np.asarray(start)[[0, 1, -1]], place.pose) for place in script.places])
    t = np.linspace(begins, ends, _SCANS).T.ravel()
    blank = Series(t, np.ones((len(t), model.laser.beams)), tuple(f"r{i}" for i in range(model.laser.beams)))
    stood = np.stack([begins - _REST, ends + _REST], axis=1).ravel()
    pose = Series(stood, np.repeat(poses, 2, axis=0), ("x", "y", "theta"))
    run = Run("plan", pose=pose, scan=blank)
    shots = gather(Recording(script.name, (run,), train=("plan",), world=path, truth=truth), model)
    measured = predict(shots, (), hits_of(shots, (), 0), 0)
    assembly = Assembly(replace(shots, measured=measured), wanted)
    noise = ScanNoise(*truth, *_COMMON)
    count = sum(len(form.columns) for form in assembly.forms)
    normal = NormalEquations(np.empty((0, 0)), noise, noise, assembly.first, 0)
    gram = assembly.products(normal, [assembly.columns[:, :, :count]], np.zeros_like(assembly.residual))
    return assembly.forms, gram


def _distinguishable(planned: tuple[list[Form], FloatArray], wanted: Sequence[str]) -> FloatArray:
    """Return the expected log evidence [nat] for each effect at its usual size over each other one, (n, n - 1).

    Of a single effect, over none.
    """
    forms, gram = planned
    by_id = {name: [form for form in forms if form.id == name] for name in wanted}
    out = []
    for name in wanted:
        own = by_id[name]
        others = [by_id[other] for other in wanted if other != name] or [[]]
        first = own[len(own) // 2].start if own else -1
        out.append([_unexplained(gram, first, each) if own else 0.0 for each in others])
    return np.array(out)


def _unexplained(gram: FloatArray, at: int, forms: Sequence[Form]) -> float:
    """Return half the square of what the likest of some forms leaves of a column."""
    whole = float(gram[at, at])
    rest = [whole]
    for form in forms:
        inner, outer = gram[form.span, form.span], gram[form.span, at]
        rest.append(whole - float(outer @ np.linalg.lstsq(inner, outer, rcond=1e-9)[0]))
    return 0.5 * max(min(rest), 0.0)


def shortcomings(assembly: Assembly) -> list[str]:
    """Return sentences about what the scans did not see, with the scripted drive that shows it."""
    seen, trust = assembly.marks.seen, assembly.geometry
    if not trust.any():
        return ["laser: no beam hits a mapped wall away from its ends; record room_poses in a mapped room."]
    bearings = np.array([each.bearings for each in seen.beams])
    angle = seen.origins[..., 2] + bearings
    reach = np.where(trust, seen.level, 0.0)[..., np.newaxis]
    ends = seen.origins[..., :2] + reach * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    out = []
    centred = ends[trust] - ends[trust].mean(axis=0)
    # The rms distance of the ends from the line through them.
    if np.sqrt(max(np.linalg.eigvalsh(centred.T @ centred / len(centred))[0], 0.0)) < _FLAT:
        out.append(
            "laser: only one wall was seen, so that range offset, mounting and position of the wall cannot be told "
            "apart; record room_poses, which sees more walls."
        )
    if np.ptp(seen.origins[..., :2].reshape(-1, 2), axis=0).max() < _MOVED:
        out.append("laser: all scans are from one place; record room_poses or wall_five_distances.")
    ranges = seen.ranges[trust]
    if float(np.quantile(ranges, 0.98)) < _DISTANCES * float(np.quantile(ranges, 0.02)):
        out.append("laser: all walls are equally far, so effects of the range do not show; drive wall_five_distances.")
    return out
