# SPDX-License-Identifier: BSD-3-Clause
"""An effect that nobody is sure of does not move the size of one that is certain."""

from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.critic.engine import uncertain_effects
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.values.prior import log_prior
from kurumaisu.critic.values.verdict import NORMAL90, Estimate

EFFECTS = dict.fromkeys(("gain", "zone", "curve", "other"), 0.0)
SD = 0.01


def fit_of(sizes, weight, fixed=()):
    """Return a fit of effects with one parameter each, and so much of the posterior; fixed: forms of theirs."""
    terms = [SimpleNamespace(id=name, parameter=SimpleNamespace(name="size"), fixed=False) for name in sizes]
    terms += [SimpleNamespace(id=name, parameter=SimpleNamespace(name="form"), fixed=True) for name in fixed]
    return SimpleNamespace(
        candidates=frozenset(sizes),
        ids=frozenset(sizes),
        terms=tuple(terms),
        values=np.array([*sizes.values(), *([1.0] * len(fixed))]),
        score=np.log(max(weight, 1e-30)) - log_prior(len(sizes), len(EFFECTS)),
        log_likelihood=0.0,
    )


def found_of(*fits, told=()):
    weights = np.array([np.exp(fit.score + log_prior(len(fit.ids), len(EFFECTS))) for fit in fits])
    p = {name: sum(w for w, fit in zip(weights, fits, strict=True) if name in fit.ids) for name in EFFECTS}
    return SearchResult((*fits, fit_of({}, 0.0)), p, told, 0.0)


def gain_of(found):
    """Return the interval of the gain in the best set."""
    value = found.best.values[0]
    one = Estimate(value, value - NORMAL90 * SD, value + NORMAL90 * SD, "1")
    return uncertain_effects.widened_intervals(found, "gain", {"size": one})["size"]


def test_what_acts_with_less_than_a_half_is_left_out_and_its_share_is_in_the_interval():
    found = found_of(
        fit_of({"gain": 0.06, "zone": 0.004}, 0.41),
        fit_of({"gain": 0.04}, 0.39),
        fit_of({"gain": 0.02, "curve": 1.0}, 0.2),
    )
    settled = uncertain_effects.without_uncertain(found)
    assert settled.best.ids == {"gain"}
    assert len(settled.fits) == len(found.fits)
    told = gain_of(settled)
    assert told.estimate == 0.04
    assert told.hi90 - 0.04 == pytest.approx(NORMAL90 * np.hypot(SD, 0.02 * np.sqrt(0.41)))
    assert 0.04 - told.lo90 == pytest.approx(NORMAL90 * np.hypot(SD, 0.02 * np.sqrt(0.2)))


def test_what_acts_more_probably_than_not_stays():
    found = found_of(fit_of({"gain": 0.06, "zone": 0.004}, 0.6), fit_of({"gain": 0.04}, 0.4))
    assert uncertain_effects.without_uncertain(found) is found


def test_one_of_a_set_that_is_told_stays():
    fits = (
        fit_of({"gain": 0.06, "zone": 0.004}, 0.48),
        fit_of({"gain": 0.06, "curve": 0.1}, 0.46),
        fit_of({"gain": 0.0}, 0.06),
    )
    assert uncertain_effects.without_uncertain(found_of(*fits)).best.ids == {"gain"}
    assert uncertain_effects.without_uncertain(found_of(*fits, told=(("curve", "zone"),))).best.ids == {"gain", "zone"}


def test_a_smaller_set_that_was_never_fitted_is_no_choice():
    found = found_of(fit_of({"gain": 0.06, "zone": 0.004}, 0.4), fit_of({"gain": 0.06, "curve": 0.1}, 0.6))
    assert uncertain_effects.without_uncertain(found) is found


def test_a_size_in_another_form_is_another_size():
    found = found_of(fit_of({"gain": 0.04}, 0.6), fit_of({"gain": 0.9}, 0.4, fixed=["gain"]))
    assert gain_of(found).hi90 == pytest.approx(0.04 + NORMAL90 * SD)
