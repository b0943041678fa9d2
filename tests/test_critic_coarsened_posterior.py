# SPDX-License-Identifier: BSD-3-Clause
"""Evidence beside strong causes: their equations are only nearly right, so it is believed less."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logit

from kurumaisu.critic.engine import coarsened_posterior
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.values.prior import odds

EFFECTS = dict.fromkeys(("strong", "small", "rival", "other"), 0.0)


def fit_of(sizes, nats):
    """Return a fit of effects whose sizes are z, with so much evidence, its prior included."""
    score = nats - len(sizes) * (np.log(odds(len(EFFECTS))) - np.log1p(-odds(len(EFFECTS))))
    return SimpleNamespace(
        candidates=frozenset(sizes),
        ids=frozenset(sizes),
        sizes=sum(name != "sign" for name in sizes),
        terms=(),
        score=score,
        log_likelihood=0.5 * sum(z**2 for z in sizes.values()),
    )


def believed(strong, lead):
    """Return what is believed of a small effect that leads its rival, and its absence, by so many nats."""
    fits = [
        fit_of({"strong": strong, "small": 6.0}, 100.0),
        fit_of({"strong": strong, "rival": 6.0}, 100.0 - lead),
        fit_of({"strong": strong}, 100.0 - lead - 2.5),
        fit_of({}, 0.0),
    ]
    weights = np.exp([0.0, -lead, -lead - 2.5])
    weights /= weights.sum()
    p = EFFECTS | {"strong": 1.0, "small": weights[0], "rival": weights[1]}
    with np.errstate(divide="ignore"):
        odds = {name: float(logit(share)) for name, share in p.items()}
    return coarsened_posterior.of_effects(SearchResult(tuple(fits), p, (), 0.0), odds)


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


def test_where_nothing_acts_probabilities_stay_as_they_are():
    fits = (fit_of({}, 0.0), fit_of({"small": 3.0}, -1.0))
    p = EFFECTS | {"small": 0.27}
    odds = {name: float(logit(share)) for name, share in p.items()}
    assert coarsened_posterior.of_effects(SearchResult(fits, p, (), 0.0), odds)[0] == pytest.approx(p)


def test_a_cause_that_drowns_all_else_is_certain():
    """At z = 250 log odds are 31 000: as a probability they would be 1 - 1e-16, that is 36, and be no more than 2.4."""
    fits = (fit_of({"strong": 250.0}, 31000.0), fit_of({"strong": 250.0, "small": 1.0}, 30995.0), fit_of({}, 0.0))
    p, sets = coarsened_posterior.of_effects(SearchResult(fits, EFFECTS, (), 0.0), {"strong": 31000.0, "small": -5.0})
    assert p["strong"] > 0.999
    assert p["small"] == pytest.approx(np.exp(-5.0), rel=0.01)  # the doubt about the strong one makes it no likelier
    assert sets == ()


def test_what_fits_worse_than_nothing_makes_no_cause_stronger():
    """A sign that is not wrong explains nothing at all: it must not count as what acts."""
    fits = (
        fit_of({"strong": 17.0}, 100.0),
        fit_of({"rival": 16.8}, 95.0),
        fit_of({}, 0.0),
        fit_of({"other": 0.0}, -1e4),
    )
    fits[-1].log_likelihood = -1e4
    p, _ = coarsened_posterior.of_effects(SearchResult(fits, EFFECTS, (), 0.0), {"strong": 4.9})
    assert p["strong"] > 0.98


def test_a_simpler_cause_of_the_same_is_certain_however_strong_it_is():
    """A factor of -1 needs nothing to be fitted; a gain of -2 does the same, and costs 20 nats."""

    def p_of(name, odds):
        found = SearchResult(
            (fit_of({name: 300.0}, 44980.0), fit_of({"rival": 300.0}, 44960.0), fit_of({}, 0.0)), EFFECTS, (), 0.0
        )
        return coarsened_posterior.of_effects(found, {name: odds})[0][name]

    assert p_of("sign", 20.0) > 0.999
    assert p_of("strong", 20.0) < 0.9  # what is fitted as well only happened to be likelier
    assert p_of("sign", 3.0) < 0.9  # a curve is nearer than the gain


@pytest.mark.parametrize("p", [0.0, 0.3, 0.93, 1.0])
def test_what_a_set_leaves_is_doubted_as_the_set_is(p):
    """Noise that grows is judged by the residuals, which strong causes leave larger where they are large."""
    weak, strong = (SearchResult((fit_of({"strong": z}, 10.0), fit_of({}, 0.0)), EFFECTS, (), 0.0) for z in (1.0, 60.0))
    assert coarsened_posterior.of_finding(weak, p) == pytest.approx(p, abs=1e-3)
    if 0.5 < p < 1.0:
        assert 0.5 < coarsened_posterior.of_finding(strong, p) < p - 0.05
    else:
        assert coarsened_posterior.of_finding(strong, p) >= p
