# SPDX-License-Identifier: BSD-3-Clause
"""What belongs to a set of effects of the laser that cannot be told apart, which beams may speak, and what matters."""

from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.critic.laser.columns import Column, Form
from kurumaisu.critic.laser.free import Free
from kurumaisu.critic.laser.grids import grid_of
from kurumaisu.critic.laser.search import Search
from kurumaisu.critic.laser.trust import trusted_place
from kurumaisu.critic.laser.twins import twins
from kurumaisu.critic.laser.verdicts import size_where_it_acts
from kurumaisu.effects import Parameter

SIZE = Parameter("size", "m", null=0.0, scale=0.01, lower=-1.0, upper=1.0)
TAU = Parameter("tau", "s", null=900.0, scale=600.0, lower=1.0, upper=2.0e4)


@pytest.mark.parametrize(("walls", "a_set"), [(1, True), (12, False)])
def test_many_walls_do_not_imitate_an_effect_by_chance(walls, a_set):
    """Walls at any places explain as much as the effect of which each sees a part; but who would put them there?"""
    readings = 240
    rng = np.random.default_rng(2)
    effect = np.ones(readings)
    block = np.kron(np.eye(walls), np.ones((readings // walls, 1)))
    y = 2.0 * effect + rng.standard_normal(readings)
    rows = np.column_stack([effect, block, y])
    form = Form("an.effect", {}, (Column(SIZE, squared=False, beside={}),), 0)
    free = Free("a.map", SIZE, None, (np.eye(walls),), slice(1, 1 + walls))
    gram = rows.T @ rows
    found = Search([form], gram).run()
    assert found.best.ids == {"an.effect"}
    groups = twins(found, None, [free], gram, ["an.effect"])
    assert groups == ((("a.map", "an.effect"),) if a_set else ())


def test_a_time_that_a_short_drive_does_not_see_is_tried():
    """In a minute, what dies away in a quarter of an hour and more is an offset."""
    times = grid_of(TAU, 60.0)
    assert times[0] == max(times) > 2400
    assert min(times) < 10
    assert max(grid_of(TAU, 3600.0)) == 4 * 3600


def test_beams_along_a_wall_do_not_speak():
    angles = np.radians([0.0, 40.0, 74.0, 76.0, 79.0])
    beams = 40
    incidence = np.repeat(angles[:, np.newaxis], beams, axis=1)
    level = 1 / np.cos(np.linspace(-0.1, 0.1, beams))  # of a straight wall
    seen = SimpleNamespace(incidence=incidence, level=np.repeat(level[np.newaxis], 5, axis=0))
    laser = SimpleNamespace(range_min=0.06, range_max=4.0, angle_increment=0.2 / (beams - 1))
    place = trusted_place(SimpleNamespace(laser=laser), seen, np.full_like(incidence, 2.0))
    assert place[:, beams // 2].tolist() == [True, True, True, False, False]


def test_what_acts_in_a_sector_is_not_made_small_by_the_others():
    change = np.zeros(1000)
    change[:100] = -8e-4
    assert size_where_it_acts(change) == pytest.approx(8e-4)
    assert size_where_it_acts(np.full(1000, 5e-4)) == pytest.approx(5e-4)
    assert size_where_it_acts(np.zeros(10)) == 0
