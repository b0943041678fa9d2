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
    score = nats - len(sizes) * (np.log(odds(len(EFFECTS))) - np.log1p(-odds(len(EFFECTS))))
    return SimpleNamespace(
        candidates=frozenset(sizes),
        ids=frozenset(sizes),
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
    return coarse.believed(Naming(tuple(fits), p, (), 0.0), p)


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
    assert coarse.believed(Naming(fits, p, (), 0.0), p)[0] == pytest.approx(p)


def test_what_rounding_leaves_of_certainty_is_no_doubt():
    """Shares are sums of exponentials of logs of thousands of nats: their last digits mean nothing."""
    fits = (fit_of({"strong": 300.0}, -9000.0), fit_of({}, -54000.0))
    for share in (1.0 - 3e-13, 1.0 + 3e-13):
        assert coarse.believed(Naming(fits, EFFECTS, (), 0.0), EFFECTS | {"strong": share})[0]["strong"] == 1.0
    doubted = coarse.believed(Naming(fits, EFFECTS, (), 0.0), EFFECTS | {"strong": 1.0 - 1e-9})[0]["strong"]
    assert doubted < 0.8
