# SPDX-License-Identifier: BSD-3-Clause
"""What a cause of the laser is worth, and how far its size may be off: another form of its equation included."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from laser_scene import recording, sparse

from kurumaisu.critic.judge.merge import with_scans
from kurumaisu.critic.judge.scan_estimates import another_map
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.judge.scatter_verdict import _spread_of
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.search.block_evidence import SetWithBlock, compare_blocks
from kurumaisu.critic.ranges.search.effect_sets import FittedForms, FormSearch
from kurumaisu.critic.ranges.search.mean_effects import gain_of
from kurumaisu.critic.ranges.search.misfits import Part
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.ranges.search.parameter_fit import fit_parameters
from kurumaisu.critic.ranges.signals.coefficient_blocks import Block
from kurumaisu.critic.ranges.signals.effect_columns import Column, Form
from kurumaisu.critic.unknown.curves import CurveEvidence
from kurumaisu.critic.values.criticism import Criticism, LaserFinding
from kurumaisu.critic.values.policy import FORM_ERROR
from kurumaisu.critic.values.story import Story
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.effects import Parameter
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
NONE = FittedForms((), np.empty(0), np.empty(0), 0.0, 0.0)
NAMED = FittedForms((Form("laser.warmup", {}, (), 0),), np.empty(0), np.empty(0), 700.0, 690.0)
CURVE = Block("smooth.range.time", None, SimpleNamespace(), (), slice(1, 9))


@pytest.mark.parametrize(("leads", "gain"), [(False, 690.0), (True, -30.0)])
def test_a_curve_out_of_the_running_does_not_make_a_named_cause_worth_less_than_nothing(leads, gain):
    """A curve follows a slightly other form than the equation's by more than the equation, and stands for it."""
    rival = SetWithBlock(NONE, CURVE, CurveEvidence(720.0, np.eye(8)), 720.0)
    found = SimpleNamespace(fits=(NAMED, NONE))
    made = SimpleNamespace(
        found=found,
        weighed=SimpleNamespace(found=found, rivals=(rival,)),
        winner=rival if leads else None,
        curve=leads,
        more=None,
    )
    assert gain_of(made, "laser.warmup") == pytest.approx(gain)


@pytest.mark.parametrize(("size", "found"), [(0.1, {"laser.quadratic"}), (0.0, set())])
def test_beside_walls_that_are_where_they_like_an_effect_needs_evidence_only(size, found):
    """A share of what the walls do, 35 nats here, is asked of nothing beside them: they have no equation."""
    rng = np.random.default_rng(1)
    walls = rng.integers(0, 12, 6000)
    bent = rng.standard_normal(6000)
    readings = size * bent + 0.8 * rng.standard_normal(12)[walls] + rng.standard_normal(6000)
    columns = np.column_stack([bent, np.eye(12)[walls], readings])
    gram = columns.T @ columns
    own = Column(Parameter("quadratic", "1/m", null=0.0, scale=1.0, lower=-9.0, upper=9.0), False, {})
    quadratic = Form("laser.quadratic", {}, (own,), 0)
    free = Block("world.map_error", own.parameter, None, (np.eye(12),), slice(1, 13))
    winner = compare_blocks(FormSearch([quadratic], gram).run(), [free], gram, {}).winner
    assert winner is not None
    assert winner.free is free
    assert winner.fit.ids == found


@pytest.mark.parametrize(
    ("off", "lacking", "told"), [(0.05, 0.0, False), (0.1, 0.01, False), (0.1, 0.2, True), (0.8, 0.0, True)]
)
def test_walls_that_are_farther_off_than_an_error_of_the_map_are_of_another_one(off, lacking, told):
    """Such walls are not named, and nothing else is, be the rest as it may; what the map lacks speaks for it, too."""
    sd = Parameter("sd", "m", null=0.0, scale=0.005, lower=0.0, upper=0.2)
    free = Block("world.map_error", sd, None, (np.eye(12),), slice(0, 12))
    walls = off / sd.scale * np.random.default_rng(1).standard_normal(12)
    gram = np.vstack([np.column_stack([np.eye(12), walls]), np.append(walls, walls @ walls)])
    words = another_map(
        SetWithBlock(NONE, free, CurveEvidence(100.0, np.eye(12)), 100.0), SimpleNamespace(gram=gram), lacking
    )
    assert (words is not None) == told
    assert another_map(None, SimpleNamespace(gram=gram), lacking) is None
    if words is not None:
        story = Story("", "", "", (), "", {})
        found = with_scans(
            Criticism(Verdict("none", problems=("a note",)), story, MODEL, ()), LaserFinding(wrong=words)
        )
        assert (found.verdict.verdict, found.verdict.causes) == ("invalid_data", ())
        assert found.verdict.problems == (words, "a note")
        assert "another place" in found.story.headline


def test_a_size_is_no_surer_than_the_form_that_it_belongs_to(tmp_path):
    """An offset is an offset; what grows with the range may grow otherwise, and counts at another range then."""
    shots = gather(recording(tmp_path, None, 0.0, 1, scans=16), MODEL)
    marks = Assembly(shots).marks
    sizes = {"laser.offset": {"offset": 0.4}, "laser.quadratic": {"quadratic": 0.09}}
    sds, missed = {}, {}
    for name, values in sizes.items():
        told = [EffectSetting(name, values)]
        assembly = Assembly(replace(shots, measured=marks.base + marks.together(told)))
        forms = [form for form in assembly.forms if form.id == name]
        fit = fit_parameters(assembly, assembly.settle(None), forms, told, None, {}, None)
        ((setting, known),) = fit.settings
        assert setting.parameters[name.removeprefix("laser.")] == pytest.approx(next(iter(values.values())), rel=1e-3)
        missed[name] = fit.missed
        sds |= {p: sd / setting.parameters[p] for p, sd in known.items()}
    assert sds["offset"] < 0.05
    assert 0.99 * FORM_ERROR < sds["quadratic"] < 1.2 * FORM_ERROR
    assert missed["laser.offset"].shape[2] == 0
    what = FORM_ERROR * marks.together([EffectSetting("laser.quadratic", sizes["laser.quadratic"])])
    off = np.abs(missed["laser.quadratic"][:, :, 0] - np.nan_to_num(what))
    assert np.mean(off < 1e-3) > 0.99  # but for beams beside an edge, which the sought poses move


@pytest.mark.parametrize(("name", "size"), [("laser.scale", 0.05), ("laser.cyclic", 0.03), ("laser.quadratic", 0.02)])
def test_a_cause_far_out_of_the_noise_leaves_no_scatter(tmp_path, name, size):
    """It has moved poses and made outliers of readings until it was known."""
    seen = criticise_scans(sparse(recording(tmp_path, name, size, 2)), MODEL, lambda _: None)
    assert [cause.id for cause in seen.causes] == [name]
    (told,) = (cause.parameters for cause in seen.causes)
    first = next(iter(told.values()))
    assert first.lo90 < size < first.hi90


@pytest.mark.parametrize("end", [2.437, 3.371])
def test_where_readings_are_cut_off_is_known_to_a_step_of_them(tmp_path, end):
    """Wherever that is between the usual sizes: the pile says it."""
    data = recording(tmp_path, None, 0.0, 4, scans=30)
    run = data.runs[0]
    cut = np.minimum(run.scan.values, end)
    data = replace(data, runs=(replace(run, scan=replace(run.scan, values=cut)),))
    seen = criticise_scans(data, MODEL, lambda _: None, frozenset({"laser.saturation", "laser.crosstalk"}))
    (cause,) = seen.causes
    told = cause.parameters["inverse_far"]
    assert told.lo90 < 1 / end < told.hi90
    assert told.hi90 - told.lo90 < 0.005 / end**2


@pytest.mark.parametrize(("name", "spread"), [("laser.mount_x", 0.0), ("laser.quadratic", 0.005), ("a.map", 0.005)])
def test_only_equations_that_are_nearly_right_may_have_scans_off_together(name, spread):
    """Where a laser sits is geometry, which nobody may draw otherwise; a square of the range or walls are not."""
    columns = np.ones((2, 4, 1)) * [[[1.0], [3.0], [1.0], [3.0]]]
    made = SimpleNamespace(parts=lambda: [Part(name, slice(0, 1), np.array([0.005]))], others={})
    assembly = SimpleNamespace(columns=columns, free=[SimpleNamespace(id="a.map")])
    normal = SimpleNamespace(beam_noise=SimpleNamespace(valid=np.ones((2, 4), dtype=bool)))
    assert _spread_of(assembly, normal, made) == pytest.approx(spread)
    made.others = {name: SimpleNamespace()}
    assert _spread_of(assembly, normal, made) == 0.0
