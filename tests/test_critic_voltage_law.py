# SPDX-License-Identifier: BSD-3-Clause
"""Whose voltage law commands without voltages go by: the model's, unless they ask for more than it can say."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.critic.by_effect import Ask
from kurumaisu.bench.hidden.make import make
from kurumaisu.critic import pipeline
from kurumaisu.critic.base.replay import model_of
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import shipped

MD100 = shipped("launch/md100.yaml")


def law_of(*rates, columns=("v", "w"), assume_law=False, **more):
    t = np.arange(float(len(rates)))
    run = Run("a", command=Series(t, np.array(rates, float), columns), **more)
    return model_of(Recording("r", (run,), train=("a",)), MD100, assume_law=assume_law).law_name


def test_commands_that_the_chair_could_be_given_go_by_its_law():
    assert law_of((0.0, 0.0), (1.5, -1.7), (-0.9, 2.2), (np.nan, 0.1)) == "published"


@pytest.mark.parametrize("rates", [(1.6, 0.0), (-0.95, 0.0), (0.0, 2.3), (0.0, -2.6)])
def test_commands_beyond_its_voltages_are_those_of_another_make(rates):
    assert law_of((0.1, 0.1), rates) == "identity"
    assert law_of((0.1, 0.1), rates, assume_law=True) == "published"


def test_who_recorded_voltages_has_a_law():
    volts = Series(np.arange(2.0), np.zeros((2, 2)), ("v_f", "v_s"))
    assert law_of((0.1, 0.1), (5.0, 0.0), voltage=volts) == "published"


def test_the_other_steering_law_is_found_without_voltages(tmp_path):
    case = make(Ask("single", ("base.steering_law",), family="base", form="plain"), 31190, tmp_path)
    silent = replace(case.recording, runs=tuple(replace(run, voltage=None) for run in case.recording.runs))
    rivals = ("steering_law", "dac_zero_s", "dead_zone_w", "gain_w", "curvature_w", "left_right_gain", "sign")
    ids = frozenset(f"base.{name}" for name in rivals)
    verdict = pipeline.criticise(silent, MD100, lambda _: None, ids=ids).verdict
    assert [cause.id for cause in verdict.causes] == ["base.steering_law"]
