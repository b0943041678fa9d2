# SPDX-License-Identifier: BSD-3-Clause
"""What a cause of the laser is worth, and how far its size may be off: another form of its equation included."""

from types import SimpleNamespace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.critic.laser.columns import Form
from kurumaisu.critic.laser.free import Free
from kurumaisu.critic.laser.normal import Assembly
from kurumaisu.critic.laser.pinned import pinned
from kurumaisu.critic.laser.rivals import Rival
from kurumaisu.critic.laser.search import Fitted
from kurumaisu.critic.laser.shots import gather
from kurumaisu.critic.laser.verdicts import _gain
from kurumaisu.critic.smooth import Belief
from kurumaisu.critic.smooth_alike import FORM
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
NONE = Fitted((), np.empty(0), np.empty(0), 0.0, 0.0)
NAMED = Fitted((Form("laser.warmup", {}, (), 0),), np.empty(0), np.empty(0), 700.0, 690.0)
CURVE = Free("smooth.range.time", None, SimpleNamespace(), (), slice(1, 9))


@pytest.mark.parametrize(("leads", "gain"), [(False, 690.0), (True, -30.0)])
def test_a_curve_out_of_the_running_does_not_make_a_named_cause_worth_less_than_nothing(leads, gain):
    """A curve follows a slightly other form than the equation's by more than the equation, and stands for it."""
    rival = Rival(NONE, CURVE, Belief(720.0, np.eye(8)), 720.0)
    found = SimpleNamespace(fits=(NAMED, NONE))
    made = SimpleNamespace(
        found=found, weighed=SimpleNamespace(found=found, rivals=(rival,)), winner=rival if leads else None
    )
    assert _gain(made, "laser.warmup") == pytest.approx(gain)


def test_a_size_is_no_surer_than_the_form_that_it_belongs_to(tmp_path):
    """An offset is an offset; what grows with the range may grow otherwise, and counts at another range then."""
    assembly = Assembly(gather(recording(tmp_path, None, 0.0, 1, scans=16), MODEL))
    normal = assembly.settle(None)
    sizes = {"laser.offset": {"offset": 0.4}, "laser.quadratic": {"quadratic": 0.09}}
    sds = {}
    for name, values in sizes.items():
        forms = [form for form in assembly.forms if form.id == name]
        assembly.residual = assembly.marks.together([EffectSetting(name, values)])
        ((setting, known),) = pinned(assembly, normal, forms, [EffectSetting(name, values)], None, None).settings
        sds |= {p: sd / setting.parameters[p] for p, sd in known.items()}
    assert sds["offset"] < 0.05
    assert FORM < sds["quadratic"] < 1.2 * FORM
