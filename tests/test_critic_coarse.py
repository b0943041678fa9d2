# SPDX-License-Identifier: BSD-3-Clause
"""Evidence beside strong causes: their equations are only nearly right, so it is believed less."""

from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.critic import coarse
from kurumaisu.critic.naming import Naming
from kurumaisu.critic.prior import odds

EFFECTS = dict.fromkeys(("strong", "small", "rival", "other"), 0.0)


def fit_of(sizes, nats):
    """Return a fit of effects whose sizes are z, with so much evidence, its prior included."""
    terms = tuple(SimpleNamespace(id=name, null=0.0) for name in sizes)
    score = nats - len(sizes) * (np.log(odds(len(EFFECTS))) - np.log1p(-odds(len(EFFECTS))))
    return SimpleNamespace(
        candidates=frozenset(terms_of(sizes)),
        ids=frozenset(sizes),
        terms=terms,
        values=np.array([*sizes.values()], dtype=float),
        score=score,
        log_likelihood=0.5 * sum(z**2 for z in sizes.values()),
    )


def terms_of(sizes):
    return [CANDIDATES[name] for name in sizes]


class Candidate(SimpleNamespace):
    __hash__ = object.__hash__


CANDIDATES = {name: Candidate(id=name) for name in EFFECTS}


def problem_of(directions):
    """Return a problem in which an effect of size z moves the residual by z along its direction."""

    def residual(terms, values):
        return -sum((value * np.array(directions[t.id]) for t, value in zip(terms, values, strict=True)), np.zeros(2))

    return SimpleNamespace(residual=residual)


def believed(strong, lead, along=0.0):
    """Return what is believed of a small effect that leads its rival, and its absence, by so many nats."""
    across = float(np.sqrt(1 - along**2))
    problem = problem_of({"strong": (1.0, 0.0), "small": (along, across), "rival": (0.0, 1.0)})
    fits = [
        fit_of({"strong": strong, "small": 6.0}, 100.0),
        fit_of({"strong": strong, "rival": 6.0}, 100.0 - lead),
        fit_of({"strong": strong}, 100.0 - lead - 2.5),
        fit_of({}, 0.0),
    ]
    weights = np.exp([0.0, -lead, -lead - 2.5])
    weights /= weights.sum()
    p = EFFECTS | {"strong": 1.0, "small": weights[0], "rival": weights[1]}
    return coarse.believed(problem, Naming(tuple(fits), p, (), 0.0), p)


def test_the_same_evidence_is_worth_less_beside_a_strong_cause():
    p, sets = believed(strong=6.0, lead=2.6)
    assert p["small"] > 0.9
    assert sets == ()
    p, sets = believed(strong=60.0, lead=2.6)
    assert p["small"] < 0.9
    assert sets == (("rival", "small"),)
    assert p["strong"] == 1.0
    assert p["other"] == 0.0


def test_much_evidence_stays_certain_beside_a_strong_cause():
    p, sets = believed(strong=60.0, lead=9.0)
    assert p["small"] > 0.98
    assert sets == ()


@pytest.mark.parametrize(("along", "certain"), [(0.0, True), (0.9, False)])
def test_what_lies_along_a_strong_cause_may_be_what_its_equation_leaves(along, certain):
    p, _ = believed(strong=30.0, lead=4.0, along=along)
    assert (p["small"] >= 0.9) is certain
    assert p["strong"] == 1.0


def test_where_nothing_acts_probabilities_stay_as_they_are():
    fits = (fit_of({}, 0.0), fit_of({"small": 3.0}, -1.0))
    p = EFFECTS | {"small": 0.27}
    assert coarse.believed(problem_of({}), Naming(fits, p, (), 0.0), p)[0] == pytest.approx(p)
