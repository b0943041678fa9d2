# SPDX-License-Identifier: BSD-3-Clause
"""What belongs to a set of effects of the laser that cannot be told apart, which beams may speak, and what matters."""

from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.critic.judge.reference_faults import from_base_link, ruled_out, without_double_delay
from kurumaisu.critic.ranges.scans.valid_readings import usable_beams
from kurumaisu.critic.ranges.search.block_evidence import compare_blocks
from kurumaisu.critic.ranges.search.confounding import confounded
from kurumaisu.critic.ranges.search.effect_sets import FormSearch
from kurumaisu.critic.ranges.signals.coefficient_blocks import Block
from kurumaisu.critic.ranges.signals.effect_columns import Column, Form, grid_of
from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.critic.values.criticism import LaserFinding
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.verdict import Cause, Estimate
from kurumaisu.effects import Parameter, by_id
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
SIZE = Parameter("size", "m", null=0.0, scale=0.01, lower=-1.0, upper=1.0)
TAU = Parameter("tau", "s", null=900.0, scale=600.0, lower=1.0, upper=2.0e4)


@pytest.mark.parametrize(("walls", "a_set"), [(1, True), (12, False)])
def test_many_walls_do_not_imitate_an_effect_by_chance(walls, a_set):
    """Walls at any places explain as much as the effect of which each sees a part; but who would put them there?"""
    readings = 240
    rng = np.random.default_rng(2)
    effect = np.ones(readings)
    block = np.kron(np.eye(walls), np.ones((readings // walls, 1)))
    y = 2.0 * effect + rng.standard_normal(readings)
    rows = np.column_stack([effect, block, y])
    form = Form("an.effect", {}, (Column(SIZE, squared=False, beside={}),), 0)
    free = Block("a.map", SIZE, None, (np.eye(walls),), slice(1, 1 + walls))
    gram = rows.T @ rows
    found = FormSearch([form], gram).run()
    assert found.best.ids == {"an.effect"}
    groups = confounded(found, None, [free], gram, ["an.effect"])
    assert groups == ((("a.map", "an.effect"),) if a_set else ())


def test_a_curve_that_is_a_level_draws_an_offset_not_a_warm_up_that_has_hardly_begun():
    readings = 300
    times = np.linspace(0.0, 150.0, readings)
    knots = np.linspace(0.0, 150.0, 5)
    basis = Basis("time", knots, {}, (np.eye(5),), 0.0, 150.0)
    level = np.ones(readings)
    y = 3.0 * level + np.random.default_rng(3).standard_normal(readings)
    gram = np.column_stack([level, np.exp(-times / 2500.0), basis.matrix(times), y])
    ids = ("laser.offset", "laser.warmup")
    forms = [Form(name, {}, (Column(SIZE, squared=False, beside={}),), i) for i, name in enumerate(ids)]
    free = Block("smooth.range.time", None, basis, (np.eye(5),), slice(2, 7))
    gram = gram.T @ gram
    rivals = compare_blocks(FormSearch(forms, gram).run(), [free], gram, {}).rivals
    assert {rival.form_of for rival in rivals if not rival.fit.forms} == {"laser.offset"}


def test_a_time_that_a_short_drive_does_not_see_is_tried():
    """In a minute, what dies away in a quarter of an hour and more is an offset."""
    times = grid_of(TAU, 60.0)
    assert times[0] == max(times) > 2400
    assert min(times) < 10
    assert max(grid_of(TAU, 3600.0)) == times[0]  # in no hour more is known of what lasts for hours
    assert min(grid_of(TAU, 36000.0)) < 100
    lag = next(p for p in by_id("laser.temperature").parameters if p.name == "lag")
    assert grid_of(lag, 600.0)[0] == 0.0
    assert all(np.diff(grid_of(lag, 600.0)[1:]) < 0)


def test_beams_along_a_wall_do_not_speak():
    angles = np.radians([0.0, 40.0, 74.0, 76.0, 79.0])
    beams = 40
    incidence = np.repeat(angles[:, np.newaxis], beams, axis=1)
    level = 1 / np.cos(np.linspace(-0.1, 0.1, beams))  # of a straight wall
    seen = SimpleNamespace(incidence=incidence, level=np.repeat(level[np.newaxis], 5, axis=0))
    laser = SimpleNamespace(range_min=0.06, range_max=4.0, angle_increment=0.2 / (beams - 1))
    place = usable_beams(SimpleNamespace(laser=laser), seen, np.full_like(incidence, 2.0))
    assert place[:, beams // 2].tolist() == [True, True, True, False, False]


def cause(name, parameter, size, half):
    return Cause(name, 1.0, {parameter: Estimate(size, size - half, size + half, "m")}, 50.0)


@pytest.mark.parametrize(
    ("mount", "named"),
    [(-0.050, False), (0.050, True), (-0.020, True)],
    ids=["the reference's point, seen by the scans", "the same way", "less than that"],
)
def test_a_point_off_base_link_does_not_move_the_laser_too(mount, named):
    """The scans are then looked at from base_link, where they may show something else."""
    first = cause("laser.mount_x", "x", mount, 0.0004)
    shift = EffectSetting("laser.mount_x", {"x": mount})
    finding = LaserFinding(causes=(first,), settings=(shift,))
    drives = (cause("base.marker_x", "x", 0.0506, 0.0015), cause("base.gain_v", "gain", 0.05, 0.01))
    pose = Series(np.arange(2.0), np.array([[1.0, 2.0, 0.0], [1.0, 2.0, np.pi / 2]]), ("x", "y", "theta"))
    looked = []

    def look(moved):
        looked.append(moved)
        return LaserFinding(causes=(cause("laser.scale", "scale", 0.001, 0.0001),))

    recording = Recording("drives", (Run("one", pose=pose), Run("two")), ("one", "two"))
    seen, settings = from_base_link(drives, finding, recording, MODEL, look)
    if named:
        assert (seen, settings, looked) == (finding, finding.settings, [])
        return
    assert [one.id for one in seen.causes] == ["laser.scale"]
    assert settings == (shift,), "to the reference, the laser sits there"
    assert any("laser.mount_x" in line and "base.marker_x" in line for line in seen.details)
    assert looked[0].runs[0].pose.values[:, :2] == pytest.approx(np.array([[0.95, 2.0], [1.0, 1.95]]))


SET = ("base.cross_w_to_v", "base.marker_y")


@pytest.mark.parametrize(
    ("mount", "there", "out"),
    [
        (-0.020, None, ["base.cross_w_to_v"]),
        (None, 0.020, ["base.marker_y"]),
        (0.003, 0.023, []),
        (None, None, []),
    ],
    ids=["scans see the point", "scans see base_link", "the laser is off, too", "scans see nothing"],
)
def test_scans_tell_which_point_the_reference_measures(mount, there, out):
    """A point to the left of base_link and a chair that turns about another one look alike to the drives."""
    point, looked = cause("base.marker_y", "y", 0.020, 0.001), []

    def seen(size):
        return LaserFinding() if size is None else LaserFinding(causes=(cause("laser.mount_y", "y", size, 0.0004),))

    def look(recording):
        looked.append(recording)
        return seen(there)

    pose = Series(np.array([0.0]), np.array([[1.0, 2.0, 0.0]]), ("x", "y", "theta"))
    recording = Recording("drives", (Run("one", pose=pose),), ("one",))
    told = ruled_out((point,), (SET,), seen(mount), recording, MODEL, look)
    assert list(told) == out
    if out != ["base.cross_w_to_v"]:
        assert looked[0].runs[0].pose.values[0, :2] == pytest.approx([1.0, 1.98]), "from where base_link would be"


def test_scans_that_say_nothing_refute_nothing():
    point, finding = cause("base.marker_y", "y", 0.020, 0.001), LaserFinding(refused="there is no map")
    assert ruled_out((point,), (SET,), finding, Recording("none", (), ()), MODEL, None) == {}


def test_what_shifts_no_point_is_left_alone():
    """A reference's clock and a laser that is tilted move nothing to another place."""
    late = Cause("laser.latency", 1.0, {"delay": Estimate(0.05, 0.04, 0.06, "s")}, 50.0)
    clock = Cause("base.clock_scale", 1.0, {"scale": Estimate(0.05, 0.04, 0.06, "1")}, 50.0)
    finding = LaserFinding(causes=(late,))
    assert from_base_link((clock,), finding, Recording("none", (), ()), MODEL, None) == (finding, ())


@pytest.mark.parametrize(
    ("first", "delay", "named"),
    [(42.0, -0.0168, False), (42.0, 0.02, True), (42.0, -0.01, True), (0.0, 0.0004, True)],
    ids=["they agreed at the first scan", "a delay beside a drift", "they agreed before", "the scans begin at time 0"],
)
def test_clocks_that_agree_at_the_first_scan_are_no_delay(first, delay, named):
    """Beams are fired at t - delay - skew t: that is t where t is minus delay / skew."""
    late = Cause("laser.latency", 1.0, {"delay": Estimate(delay, delay - 4e-4, delay + 4e-4, "s")}, 50.0)
    drift = Cause("laser.clock_skew", 1.0, {"skew": Estimate(4e-4, 3.9e-4, 4.1e-4, "1")}, 50.0)
    settings = (EffectSetting("laser.latency", {"delay": delay}), EffectSetting("laser.clock_skew", {"skew": 4e-4}))
    told = without_double_delay(LaserFinding(causes=(late, drift), settings=settings), first + np.arange(9.0), MODEL)
    assert [cause.id for cause in told.causes] == ["laser.latency", "laser.clock_skew"][1 - named :]
    assert told.settings == settings
    assert bool(told.details) != named
    assert without_double_delay(LaserFinding(causes=(late,)), first + np.arange(9.0), MODEL).causes == (late,)
