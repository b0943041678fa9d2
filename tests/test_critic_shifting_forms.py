# SPDX-License-Identifier: BSD-3-Clause
"""An offset of half a step beside steps is one cause: the remainder of each reading is cut off."""

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.critic.judge.scan_estimates import with_shifting_forms
from kurumaisu.critic.values.verdict import Cause, Estimate
from kurumaisu.effects import Echoes
from kurumaisu.params import EffectSetting

STEPS, SHIFT = "laser.quantisation", "laser.offset"


def told(step, offset, half=1e-4, own=0.0, certain=True):
    steps = Cause(STEPS, 1.0, {"step": Estimate(step, step - half, step + half, "m")}, 50.0)
    shift = Cause(SHIFT, 0.99, {"offset": Estimate(offset, offset - half, offset + half, "m")}, 900.0)
    settings = {
        STEPS: EffectSetting(STEPS, {"step": step, "cut": own}),
        SHIFT: EffectSetting(SHIFT, {"offset": offset}),
    }
    return (
        with_shifting_forms((steps, shift), settings) if certain else with_shifting_forms((steps,), settings, (shift,))
    )


@pytest.mark.parametrize(("own", "certain"), [(0.0, True), (1.0, True), (0.0, False)])
@pytest.mark.parametrize(("offset", "cut"), [(-0.00345, 1.0), (0.0034, -1.0), (-0.003, 1.0)])
def test_half_a_step_is_told_with_the_steps(offset, cut, own, certain):
    """Whichever form the scatter had taken: it sees the steps, not by how much readings are off.

    A constant error that may be a warm-up which has hardly begun as well is one, too.
    """
    (cause,), (setting,) = told(0.0069, offset, own=own, certain=certain)
    assert (cause.id, cause.gain_nats) == (STEPS, 950.0)
    assert setting.parameters == {"step": 0.0069, "cut": cut}


@pytest.mark.parametrize(("step", "offset"), [(0.0069, -0.0026), (0.0069, 0.0), (0.0002, -0.0001)])
def test_another_offset_or_one_that_may_be_none_is_told_by_itself(step, offset):
    causes, settings = told(step, offset)
    assert [cause.id for cause in causes] == [STEPS, SHIFT]
    assert len(settings) == 2


@pytest.mark.parametrize(
    ("cut", "read"), [(None, [1.01, 1.01, 1.02]), (1.0, [1.0, 1.01, 1.01]), (-1.0, [1.01, 1.02, 1.02])]
)
def test_the_remainder_is_rounded_or_cut_off(cut, read):
    """A model file may leave out which: then readings are rounded."""
    values = {"step": 0.01} | ({} if cut is None else {"cut": cut})
    chain = effects.build_laser((EffectSetting(STEPS, values),), np.random.default_rng(0))
    ranges = np.array([1.0075, 1.0125, 1.0175])
    none = 0 * ranges
    echoes = Echoes(0.0, none, ranges, none, none + 1, ranges, none, none, ranges)
    np.testing.assert_allclose(chain.read(echoes), read)
