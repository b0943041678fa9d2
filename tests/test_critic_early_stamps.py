# SPDX-License-Identifier: BSD-3-Clause
"""Stamps of the reference that are early: said, and not made into what a chair does."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import draw_drives, recording
from kurumaisu.bench.hidden.generator.motion import Fault
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.critic import pipeline
from kurumaisu.critic.sanity import early_stamps
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.params import shipped


def _made(seed: int, *faults: Fault, seconds: float = 30.0) -> Recording:
    drives = draw_drives("rich", USUAL, np.random.default_rng(seed), seconds=seconds, rate=20.0)
    return recording("made", drives, list(faults))


def _stamped(made: Recording, earlier: float) -> Recording:
    runs = []
    for run in made.runs:
        assert run.pose is not None
        runs.append(replace(run, pose=replace(run.pose, t=run.pose.t - earlier)))
    return replace(made, runs=tuple(runs))


def _verdict(made: Recording) -> Verdict:
    return pipeline.criticise(made, shipped("launch/md100.yaml"), lambda _: None).verdict


def test_a_stamp_at_the_other_end_of_a_period_is_noted() -> None:
    made = _made(6)
    assert _verdict(made).problems == ()
    told = _verdict(_stamped(made, early_stamps.tolerated_lead(made.runs) / 1.25))
    assert told.verdict == "none"
    assert any("before its command" in problem for problem in told.problems)


def test_clocks_that_differ_by_more_are_wrong_data() -> None:
    told = _verdict(_stamped(_made(5), 0.14))
    assert told.verdict == "invalid_data"
    assert any("try t of the reference pose +0.1" in problem for problem in told.problems)


@pytest.mark.parametrize("cause", ["base.lag_w", "base.accel_limit", "base.gain_v", "base.payload"])
def test_what_a_chair_does_is_no_clock(cause: str) -> None:
    rng = np.random.default_rng(8)
    told = _verdict(_made(7, BASE[cause].fault(BASE[cause].draw(rng), "other")))
    assert not any("before its command" in problem for problem in told.problems)
    assert cause in [named.id for named in told.causes] + [each for one in told.confounded for each in one]


def test_an_input_of_one_row_has_no_period_of_its_own() -> None:
    made = _made(5)
    runs = []
    for run in made.runs:
        assert run.command is not None
        one = replace(run.command, t=run.command.t[:1], values=run.command.values[:1])
        runs.append(replace(run, command=one, voltage=None))
    assert early_stamps.tolerated_lead(runs) == 0.125
