# SPDX-License-Identifier: BSD-3-Clause
"""Least squares where one parameter has many likely values, whose slope leads nowhere."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.critic.engine import least_squares
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.effects import Parameter

SMOOTH = Term("smooth", Parameter("size", "1", null=0.0, scale=1.0, lower=-5.0, upper=5.0), 0.0, step=1.0)
ROUGH = replace(SMOOTH, id="rough", rough=True)
TOOTH = 0.5


class Tooth:
    """The smooth size should be 1; the rough one sits on its peak, a very narrow one, but its slope says otherwise."""

    def residual(self, terms, values):
        off = [value - TOOTH for term, value in zip(terms, values, strict=True) if term.rough]
        return np.array([5.0 * (values[0] - 1.0), *(10.0 * (np.abs(off) > 1e-9))])

    def linearised(self, terms, values, of):
        slopes = np.array([[-5.0, 3.0], [0.0, 50.0]])[: len(of), : len(of)]
        return self.residual(terms, values), slopes


@pytest.mark.parametrize("terms", [(SMOOTH,), (SMOOTH, ROUGH)])
def test_what_is_smooth_is_fitted_though_a_comb_leads_astray(terms):
    found = least_squares.least_squares(Tooth(), terms, np.array([0.0, TOOTH])[: len(terms)])
    assert found.values[0] == pytest.approx(1.0, abs=1e-3)
    assert list(found.values[1:]) == [TOOTH] * (len(terms) - 1)
