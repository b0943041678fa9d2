# SPDX-License-Identifier: BSD-3-Clause
"""A reference whose clock runs fast: the drives name it, and the scans find it again as a clock of the laser's."""

from dataclasses import replace

import pytest
from laser_scene import recording, sparse

from kurumaisu.critic.judge.reference_faults import by_commands, by_its_clock
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.values.verdict import Cause, Estimate
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
FAST = 0.002


def look(data):
    return criticise_scans(data, MODEL, lambda _: None)


@pytest.mark.parametrize("through", [0.0, 1.0])
@pytest.mark.parametrize("fast", [FAST, -FAST])
def test_one_clock_is_one_cause(tmp_path, fast, through):
    data = sparse(recording(tmp_path, None, 0.0, 21, scans=50), 6)
    (run,) = data.runs
    pose = replace(run.pose, t=run.pose.t[0] + (run.pose.t - run.pose.t[0]) * (1 + fast))
    data = replace(data, runs=(replace(run, pose=pose),))
    finding = look(data)
    assert "laser.clock_skew" in {cause.id for cause in finding.causes}
    cause = Cause(
        "base.clock_scale",
        1.0,
        {
            "scale": Estimate(fast, 0.9 * fast, 1.1 * fast, "1"),
            "through": Estimate(through, through, through, "1"),
        },
        100.0,
    )
    again, stamped = by_its_clock([cause], finding, data, MODEL, look)
    assert again.causes == ()
    assert stamped.runs[0].pose.t == pytest.approx(run.pose.t)
    assert "base.clock_scale" in again.details[-1]
    own, same = by_its_clock([replace(cause, id="base.marker_x", parameters={})], finding, data, MODEL, look)
    assert (own, same) == (finding, data)


def test_a_laser_whose_own_clock_drifts_keeps_it(tmp_path):
    data = sparse(recording(tmp_path, None, 0.0, 21, scans=50), 6)
    (run,) = data.runs
    data = replace(data, runs=(replace(run, scan=replace(run.scan, t=run.scan.t * (1 + FAST))),))
    finding = look(data)
    assert "laser.clock_skew" in {cause.id for cause in finding.causes}
    other = Cause("base.clock_scale", 1.0, {"scale": Estimate(FAST / 3, 0.0, 0.004, "1")}, 100.0)
    assert by_its_clock([other], finding, data, MODEL, look) == (finding, data)


def test_what_the_commands_clock_has_no_need_of_is_left_out():
    settings = (
        EffectSetting("base.clock_scale", {"scale": FAST, "through": 0.0}),
        EffectSetting("base.marker_x", {"x": 0.1}),
        EffectSetting("base.gain_v", {"gain": 0.1}),
    )
    assert by_commands(settings, MODEL) == settings[1:]
