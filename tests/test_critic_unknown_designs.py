# SPDX-License-Identifier: BSD-3-Clause
"""Curves about one fit serve another one only where the chair goes and rests alike."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.noise.base_noise import START
from kurumaisu.critic.unknown.designs import Designs
from kurumaisu.params import EffectSetting, follow_commands, load_model, shipped


@pytest.mark.parametrize(("cause", "shared"), [("base.gain_w", True), ("base.dac_zero_s", False)])
def test_what_moves_a_resting_chair_has_curves_of_its_own(cause: str, shared: bool) -> None:
    """A curve acts while the chair moves: about one that creeps instead of resting, it would act all the time."""
    t = np.arange(0.0, 40.0, 0.01)
    moving = (t % 10) < 5
    v, w = 0.3 * moving, 0.5 * np.sin(t) * moving
    poses = np.column_stack([np.cumsum(v)[::10] * 0.01, np.zeros(400), np.zeros(400)])
    drive = Drive("made", "command", 0.0, v, w, t[::10], poses)
    problem = Problem([drive], follow_commands(load_model(shipped("launch/md100.yaml"))), START)
    empty = problem.fit((), {})
    small = (EffectSetting(cause, {"gain": 2e-3} if shared else {"offset": 2e-3, "rests": 0.0}),)
    best = replace(problem.fit([cause], {}), settings=small)
    designs = Designs(problem, best)
    assert (designs.about(empty) is designs.about(best)) is shared
