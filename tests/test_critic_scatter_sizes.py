# SPDX-License-Identifier: BSD-3-Clause
"""Sizes and forms of an effect on the scatter: which are tried, how far steps go, and which are needless."""

from operator import attrgetter
from types import SimpleNamespace

import numpy as np
from test_critic_laser_scatter import _Linear, at

from kurumaisu import effects
from kurumaisu.critic.scatter.scatter_fit import RoughFit, ScatterFit, ScatterPiece, StatisticsChange


class _Seldom(_Linear):
    """As strays do: of a few more in a thousand readings there may be none."""

    def __call__(self, settings, seed):
        return np.floor(super().__call__(settings, seed) + 0.5)


def test_what_is_too_rare_for_a_small_step_to_show_is_moved_by_a_longer_one():
    simulate = _Seldom({"laser.heavy_tails.outliers": (60.0, 60.0, 60.0, 0.0, 0.0)})
    fit = ScatterFit(simulate, simulate([at("laser.heavy_tails", outliers=0.0024)], 5), (), frozenset())
    start = at("laser.heavy_tails", outliers=0.0006)
    (found,), _ = fit.together([ScatterPiece(effects.by_id(start.id), start, ("outliers",))], ())
    assert 0.0014 < found.setting.parameters["outliers"] < 0.0026


def test_a_parameter_that_is_needless_beside_another_is_none():
    """By sums of changes a small share of heavier tails seemed to help."""
    simulate = _Linear(
        {
            "laser.heavy_tails.outliers": (60.0, 60.0, 60.0, 0.0, 0.0),
            "laser.heavy_tails.inverse_nu": (5.0, 5.0, 5.0, 0.3, 0.3),
        }
    )
    fit = ScatterFit(simulate, simulate([at("laser.heavy_tails", outliers=0.0024)], 5), (), frozenset())
    start = RoughFit(0.0, effects.by_id("laser.heavy_tails"), {"anywhere": 0.0}, {"inverse_nu": 0.2, "outliers": 0.001})
    found, _ = fit.alone(start, ())
    assert found.free == ("outliers",)
    assert 0.0022 < found.setting.parameters["outliers"] < 0.0026


def test_a_form_is_chosen_by_the_best_of_its_sizes_be_it_simulated_or_not():
    fit = object.__new__(ScatterFit)
    fit.likeness = SimpleNamespace(cost=lambda numbers: float(np.sum((numbers - 2.0) ** 2)))
    effect = effects.by_id("laser.incidence_noise")
    met = {0.0: np.array([2.2, 1.6]), 1.0: np.array([1.0, 1.0])}  # at a size of 1, by form: the usual one comes nearer
    pushes = [
        StatisticsChange(effect, {"tangent": form}, "gain", size, size * change)
        for form, change in met.items()
        for size in (1.0, 3.0)
    ]
    found = min(fit.rough(pushes, np.zeros(2)), key=attrgetter("low"))
    assert (found.form, found.values, found.low) == ({"tangent": 1.0}, {"gain": 2.0}, 0.0)
