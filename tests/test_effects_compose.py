# SPDX-License-Identifier: BSD-3-Clause
"""Effects compose: a little of one beside another moves the chair a little, for nobody can fit what jumps."""

from itertools import permutations

import numpy as np
import pytest

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.generator.noise import REGIMES
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.catalogue import settings_of
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.noise import base_noise
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
LITTLE = 0.02  # of a usual size
SHARE = 0.08  # of what the usual size does that a little of it may do: laws have two sides, and ramps begin in a step


@pytest.fixture(scope="module")
def problem():
    """Return a drive with turns on the spot, stops and reversals, and what it can show."""
    drives = recordings.draw_drives("rich", next(iter(REGIMES.values())), np.random.default_rng(5), seconds=40.0)
    run = recordings.recording("", drives, ()).runs[0]
    return Problem([prepare(run, MODEL)], MODEL, base_noise.START)


def sizes(candidate, share):
    """Return the values of an effect of a share of its usual size."""
    out = []
    for term in candidate.terms:
        p = term.parameter
        own = term.null if term.shape else np.clip(term.null + share * p.scale, p.lower, p.upper)
        out.append(p.lower if term.fixed else own)
    return out


def test_a_little_of_an_effect_does_little_beside_any_other(problem):
    # What has a comb of sizes jumps from step to step; what can only act or not has no size.
    smooth = [one for one in problem.candidates if not one.rough and not one.fixed]

    def moved(*acting):
        terms = tuple(term for one, _ in acting for term in one.terms)
        values = np.array([value for one, share in acting for value in sizes(one, share)])
        return problem.simulated(problem.drives[0], settings_of(terms, values)).copy()

    alone = {one: np.linalg.norm(moved((one, 1.0)) - moved()) for one in smooth}
    beside = {one: moved((one, 1.0)) for one in smooth}
    assert len(smooth) > 25
    jumps = {}
    for one, other in permutations(smooth, 2):
        if one.id != other.id and alone[one] > 1e-3:
            little = np.linalg.norm(moved((other, 1.0), (one, LITTLE)) - beside[other]) / alone[one]
            if little > SHARE:
                jumps[f"{one.id} beside {other.id}"] = float(little)
    assert not jumps
