# SPDX-License-Identifier: BSD-3-Clause
"""Too few poses to tell effects from noise, and yet something is surely wrong: amber, never green."""

from dataclasses import replace

import pytest
from hidden_effect import recording

from kurumaisu.critic import pipeline
from kurumaisu.critic.judge.unresolved import COVARIATE
from kurumaisu.params import shipped

SPARSE = 25  # of so many poses one is left


def sparse(data):
    """One run of a recording with a pose every few seconds, as from a slow camera."""
    run = data.runs[0]
    few = replace(run.pose, t=run.pose.t[::SPARSE], values=run.pose.values[::SPARSE])
    return replace(data, runs=(replace(run, pose=few),), train=(run.name,), test=())


@pytest.mark.parametrize(("effect", "size"), [("base.gain_v", 0.25), (None, 0.0)])
def test_a_quarter_too_much_is_said_of_a_dozen_poses(effect, size):
    criticism = pipeline.criticise(
        sparse(recording(effect, size, 70, 40.0)), shipped("launch/md100.yaml"), lambda _: None
    )
    verdict = criticism.verdict
    assert verdict.causes == ()
    if effect is None:
        assert verdict.verdict == "none"
        return
    assert (verdict.verdict, verdict.unknown[0].covariate) == ("unknown", COVARIATE)
    assert "too few to say what it is" in criticism.story.headline
