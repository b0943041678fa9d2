# SPDX-License-Identifier: BSD-3-Clause
"""The statistics of the viewer's benchmark."""

import numpy as np
import pytest

from kurumaisu.bench.speed.viewer.main import interval


@pytest.mark.parametrize("count", [5, 7, 8, 20, 101])
def test_the_true_median_is_in_the_interval_as_often_as_it_says(count):
    rng = np.random.default_rng(1)
    within = [low <= np.log(2) <= high for low, high in (interval(rng.exponential(size=count)) for _ in range(2000))]
    assert np.mean(within) > 0.89
    narrower = [sorted(rng.exponential(size=count))[1:-1] for _ in range(2000)]
    if count < 8:  # the next smaller one would not do
        assert np.mean([low <= np.log(2) <= high for low, *_, high in narrower]) < 0.9


def test_too_few_say_nothing():
    assert interval([1.0, 2.0, 3.0, 4.0]) is None
