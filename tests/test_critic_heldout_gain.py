# SPDX-License-Identifier: BSD-3-Clause
"""What an extension is worth on data held out: by channel, on scans, and to SLAM; beside each gain its null."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from laser_scene import recording as scanned

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import draw_drives, recording
from kurumaisu.bench.hidden.generator.case import Known
from kurumaisu.bench.hidden.generator.motion import drive as driven_by
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import gain_share, noise_of
from kurumaisu.critic.app.job import Outcome
from kurumaisu.critic.app.results import summary
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import prepare, split
from kurumaisu.critic.heldout import drive_gain, scan_gain, slam_gain
from kurumaisu.critic.heldout.slam_gain import Extension, corrected, with_scan_gain, with_slam
from kurumaisu.critic.judge.merge import confirmed_scans, refuted, with_scans
from kurumaisu.critic.values.criticism import Criticism, LaserFinding, Pictures, StandIn
from kurumaisu.critic.values.recording import Series
from kurumaisu.critic.values.story import Story
from kurumaisu.critic.values.verdict import (
    Cause,
    ChannelGain,
    Gain,
    LogDensityGain,
    Unknown,
    Verdict,
)
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
NOISE = noise_of(USUAL)
NONE = LogDensityGain(0.0, 0.0, 0.0, 0.0, 0.0)


def hidden(name, size, seed=1):
    drives = draw_drives(None, USUAL, np.random.default_rng(seed), 30.0)
    return drives, recording("made", drives, (BASE[name].fault({"size": size}, "plain"),) if name else ())


def measured(data, settings, noise=NOISE):
    drives = [prepare(run, MODEL) for run in data.runs]
    return drive_gain.measure(
        MODEL, drive_gain.folds(drives, []), lambda _: drive_gain.FittedExtension(settings), noise, noise
    )


def test_channels_add_up_and_say_where_the_gain_is():
    settings = (EffectSetting("base.gain_w", {"gain": 0.08}),)
    worth = measured(hidden("base.gain_w", 0.08)[1], settings)
    parts = {name: channel.log_density_per_sample for name, channel in worth.channels.items()}
    assert list(parts) == ["dx", "dy", "dtheta"]
    for side in ("baseline", "extended", "gain"):
        total = getattr(worth.log_density_per_sample, side)
        assert sum(getattr(part, side) for part in parts.values()) == pytest.approx(total, abs=1e-9)
    assert parts["dtheta"].lo90 > 0
    assert abs(parts["dx"].gain) < 0.1 * parts["dtheta"].gain
    assert worth.channels["dtheta"].rmse.unit == "rad"
    assert worth.channels["dtheta"].rmse.lo90 > 0


def test_what_is_not_there_gains_nothing():
    worth = measured(hidden(None, 0.0)[1], (EffectSetting("base.gain_w", {"gain": 0.05}),))
    assert worth.log_density_per_sample.hi90 < 0
    assert worth.channels["dtheta"].log_density_per_sample.hi90 < 0


def test_a_model_without_fault_is_as_good_as_noise_allows():
    """Errors of the true model are what is said to be achievable; those of the wrong one are larger."""
    worth = measured(hidden("base.gain_v", 0.08)[1], (EffectSetting("base.gain_v", {"gain": 0.08}),))
    for error in worth.rmse.values():
        assert error.extended == pytest.approx(error.achievable, rel=0.35)
    near = worth.rmse["position after 2 s"]
    assert near.baseline > 1.5 * near.achievable
    story = summary(Outcome(None, 0.0, verdict=Verdict("none", gain=worth)), 100)
    told = re.search(r"after 2 s: .*noise alone: ([\d.]+) (mm|cm|m)\)", story)
    assert float(told[1]) * {"mm": 1e-3, "cm": 1e-2, "m": 1.0}[told[2]] == pytest.approx(near.achievable, rel=0.1)


def test_a_gap_of_a_whole_turn_is_no_surprise():
    data = hidden(None, 0.0, 2)[1]
    runs = []
    for run in data.runs:
        keep = np.abs((run.pose.t % 10.0) - 4.0) > 2.0
        values = run.pose.values[keep].copy()
        values[:, 2] = np.unwrap(values[:, 2])
        runs.append(replace(run, pose=replace(run.pose, t=run.pose.t[keep], values=values)))
    with_gaps = measured(replace(data, runs=tuple(runs)), ()).log_density_per_sample
    assert with_gaps.baseline > measured(data, ()).log_density_per_sample.baseline - 1.0


def test_withheld_drives_are_judged_by_beside_the_others_but_not_across_gaps():
    data = hidden("base.gain_v", 0.08, 3)[1]
    *train, last = [prepare(run, MODEL) for run in data.runs]
    keep = np.abs((last.times % 10.0) - 4.0) > 2.0
    held = replace(last, times=last.times[keep], poses=last.poses[keep])
    splits = drive_gain.with_withheld(drive_gain.folds(train, []), train, [held])
    assert [len(split.test) for split in splits] == [1, 1, 4]
    pieces = splits[-1].test
    assert max(np.diff(piece.times).max() for piece in pieces) < 0.5
    assert sum(len(piece.times) for piece in pieces) == keep.sum()
    settings = (EffectSetting("base.gain_v", {"gain": 0.08}),)
    worth = drive_gain.measure(MODEL, splits, lambda _: drive_gain.FittedExtension(settings), NOISE, NOISE)
    assert worth.log_density_per_sample.lo90 > 0
    alone = replace(held, times=held.times[:2], poses=held.poses[:2])
    assert drive_gain.with_withheld([], train, [alone]) == []


def test_a_part_of_a_drive_still_knows_the_heading_at_its_start():
    whole = prepare(hidden(None, 0.0, 4)[1].runs[0], MODEL)
    climb = (EffectSetting("base.slope", {"climb_x": 0.1, "climb_y": 0.0}),)
    parts = np.concatenate([replay.increments(part, MODEL, climb) for part in split(whole, 4)])
    np.testing.assert_allclose(parts, replay.increments(whole, MODEL, climb), atol=1e-12)


def test_the_oracle_gains_all_and_nothing_gains_nothing():
    case = make(Ask("single", ("base.gain_w",), z=25.0, regime="usual", form="plain"), 7)
    truth = case.truth.parameters["base.gain_w"]["gain"]
    worth = measured(case.recording, (EffectSetting("base.gain_w", {"gain": truth}),))
    assert gain_share(case, worth) == pytest.approx(1.0, abs=0.03)
    half = measured(case.recording, (EffectSetting("base.gain_w", {"gain": truth / 2}),))
    assert gain_share(case, half) == pytest.approx(0.75, abs=0.08)
    assert gain_share(case, None) == 0.0
    assert gain_share(replace(case, known=None), worth) is None
    assert isinstance(case.known, Known)
    drives, _ = hidden(None, 0.0)
    still = driven_by(replace(drives.settings[0], noise=None), ())[0]
    assert len(still) == len(drives.settings[0].stamps)


def test_a_fault_of_the_laser_gains_on_scans_held_out_and_a_wrong_one_loses(tmp_path):
    right = (EffectSetting("laser.scale", {"scale": 0.01}),)
    data = scanned(tmp_path, "laser.scale", 0.01, 1, scans=28)
    worth = scan_gain.measure(data, MODEL, None, right)
    assert worth.log_density_per_sample.lo90 > 0
    assert worth.rmse.lo90 > 0
    assert worth.rmse.extended < 0.02
    nothing = scanned(tmp_path, None, 0.0, 2, scans=28)
    named = (replace(nothing.runs[0], name="a"), replace(nothing.runs[0], name="b"))
    split = replace(nothing, runs=named, train=("a",), test=("b",))
    wrong = scan_gain.measure(split, MODEL, None, right)  # with test runs nothing is fitted again
    assert wrong.log_density_per_sample.hi90 < 0
    assert scan_gain.measure(data, MODEL, None, ()) is None
    assert scan_gain.measure(replace(data, world=None), MODEL, None, right) is None


def test_a_fit_to_other_scans_finds_the_size(tmp_path):
    data = scanned(tmp_path, "laser.scale", 0.01, 3, scans=40)
    shots = scan_gain.joined([some for _, some in scan_gain.ScanPoses(data, MODEL, None).trained_runs()])
    (again,) = scan_gain.refit(shots, (EffectSetting("laser.scale", {"scale": 0.02}),))
    assert again.parameters["scale"] == pytest.approx(0.01, abs=0.002)


def test_a_fit_to_few_other_scans_never_explains_them_worse(tmp_path):
    """In a room that only gets warmer nobody tells an offset from a coefficient and a lag; the line leads far."""
    data = scanned(tmp_path, "laser.offset", 0.003, 3, scans=20)
    (run,) = data.runs
    warmth = Series(run.scan.t, 18 + 0.1 * run.scan.t[:, np.newaxis], ("temperature",))
    data = replace(data, runs=(replace(run, covariates={"temperature": warmth}),))
    shots = scan_gain.joined([some for _, some in scan_gain.ScanPoses(data, MODEL, None).trained_runs()])
    values = {"coefficient": -5e-4, "swing": 5.0, "reference": 21.9, "period": 600.0, "lag": 41.0}
    before = EffectSetting("laser.temperature", values)
    (again,) = scan_gain.refit(shots, (before,))
    known, rows = scan_gain.Expectations(shots), np.arange(len(shots.stamps))
    off = [np.nanmedian(np.abs(shots.measured - known.rows((one,), rows).mean)) for one in (before, again)]
    assert off[1] < off[0]


def bare():
    story = Story("r", "m", "", (), "", {})
    return Criticism(Verdict("named", gain=Gain(NONE)), story, MODEL, ())


def test_slam_goes_wrong_with_a_wrong_mounting_and_says_so(tmp_path: Path):
    data = make(Ask("null", design="drive", family="laser", regime="usual"), 3, tmp_path).null
    data = replace(data, train=("run_1",), test=("run_2",))  # else it would be fitted again, and found out
    wrong = (EffectSetting("laser.mount_yaw", {"yaw": 0.1}),)
    out = with_slam(bare(), data, Extension(None, wrong, lambda _: ()))
    seen = out.verdict.gain.slam
    assert seen.scans > 100
    assert seen.position.baseline < 0.02
    assert seen.heading.extended == pytest.approx(0.1, abs=0.05)
    assert seen.heading.hi90 < 0
    assert "no improvement" in out.story.details[-1]
    assert out.story.overlays[0].run == f"SLAM on {seen.run}"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scan": None}, "no scans"),
        ({"pose": None}, "no reference pose"),
        ({"pose_source": "particle filter"}, "SLAM's own"),
        ({"command": None, "voltage": None, "odom": None}, "what drove the chair"),
    ],
)
def test_why_slam_was_not_compared_is_said(tmp_path, change, words):
    data = make(Ask("null", design="drive", family="laser", regime="usual"), 3, tmp_path).null
    data = replace(data, runs=tuple(replace(run, **change) for run in data.runs))
    with pytest.raises(Error, match=words):
        slam_gain.measure(data, MODEL, lambda _: ())


def test_scans_of_another_laser_are_no_reason_to_fail(tmp_path):
    data = make(Ask("null", design="drive", family="laser", regime="usual"), 3, tmp_path).null
    data = replace(data, laser=replace(data.laser, beams=681))
    larger = (EffectSetting("laser.scale", {"scale": 0.02}),)
    told = with_slam(bare(), data, Extension(None, larger, lambda _: ())).story.details[-1]
    assert told.startswith("SLAM not compared: ")
    assert "682" in told


def test_slam_gets_the_stamps_of_a_clock_that_runs_fast_since_the_run_began(tmp_path):
    data, unix = scanned(tmp_path, None, 0.0, 4, scans=6), 1.79e9
    run = data.runs[0]
    run = replace(run, scan=replace(run.scan, t=run.scan.t + unix))
    skew = (EffectSetting("laser.clock_skew", {"skew": 1e-3}),)
    plain, free = (corrected(data, run, range(6), MODEL, some, known=True).stamps for some in ((), skew))
    since = run.scan.t[:6] - run.scan.t[0]
    np.testing.assert_allclose(plain - free, since - since / 1.001, atol=1e-6)


def test_slam_gets_the_ranges_behind_the_readings(tmp_path):
    data = scanned(tmp_path, "laser.scale", 0.02, 4, scans=6)
    run, rows = data.runs[0], list(range(6))
    plain, free = (
        corrected(data, run, rows, MODEL, settings, known=True).ranges
        for settings in ((), (EffectSetting("laser.scale", {"scale": 0.02}),))
    )
    seen = np.isfinite(plain)
    # Equation (4), and 2 % of the range more than it says.
    reading = 1.004587 * free[seen] + 0.058826 + 0.02 * free[seen]
    np.testing.assert_allclose(reading, run.scan.values[seen], atol=1e-3)
    np.testing.assert_array_equal(np.isfinite(free), seen)


def test_a_laser_alone_gives_the_overall_gain(tmp_path):
    data = scanned(tmp_path, "laser.scale", 0.01, 1, scans=12)
    right = (EffectSetting("laser.scale", {"scale": 0.01}),)
    alone = replace(bare(), verdict=Verdict("none"))
    worth = scan_gain.measure(data, MODEL, None, right)
    out = with_scan_gain(alone, worth)
    whole = out.verdict.gain
    assert whole.log_density_per_sample == whole.channels["range"].log_density_per_sample
    assert "nats per reading" in out.story.details[-1]
    beside = with_scan_gain(bare(), worth)
    assert beside.verdict.gain.log_density_per_sample == NONE
    assert scan_gain.measure(data, MODEL, None, ()) is None
    assert with_scan_gain(alone, None) == alone


def test_what_scans_held_out_refuse_is_not_told(tmp_path):
    data = scanned(tmp_path, "laser.scale", 0.01, 1, scans=12)
    wrong = (EffectSetting("laser.scale", {"scale": -0.01}),)
    worth = scan_gain.measure(replace(data, test=data.train), MODEL, None, wrong)
    assert worth.log_density_per_sample.hi90 < 0
    cause = Cause("laser.scale", 1.0, {}, 30.0)
    turned, curve = (Unknown(channel, "w", "bump", 0.9) for channel in ("reference.heading", "laser.bias"))
    finding = LaserFinding((cause,), unknown=(turned, curve), settings=wrong, details=("first",))
    assert refuted(finding, worth, frozenset({"laser.scale", "smooth.range.w"})).unknown == (turned,)
    left, gained = confirmed_scans(replace(finding, unknown=()), lambda _: worth)
    assert (left.causes, left.settings, left.details[0]) == ((), (), "first")
    assert gained is None
    assert left.details[1].startswith("laser: laser.scale explain")
    told = with_scans(replace(bare(), verdict=Verdict("none")), left)
    assert told.verdict.verdict == "none"
    assert told.settings == ()


@pytest.mark.parametrize(
    ("group", "words"),
    [
        (("laser.clock_skew", "laser.latency"), "record a longer drive with more turns"),
        (("laser.offset", "laser.warmup"), "measure it in another way"),
    ],
)
def test_a_set_of_the_laser_that_no_experiment_decides_says_what_would(group, words):
    told = with_scans(replace(bare(), verdict=Verdict("none")), LaserFinding(confounded=(group,)))
    assert told.verdict.confounded == (group,)
    assert told.story.next_drive == f"No scripted experiment can decide whether {' or '.join(group)} acts: {words}."


def test_two_of_little_evidence_that_undo_each_other_are_not_told():
    """A longer scale in a smaller map: each gains beside the other, both gain nothing."""
    settings = tuple(EffectSetting(name, {}) for name in ("laser.scale", "world.map_error"))
    causes = tuple(Cause(one.id, 0.97, {}, 6.0) for one in settings)

    def worth(some):
        seen = -0.1 if len(some) == 1 else -1e-4
        return ChannelGain(LogDensityGain(0.0, seen, seen, seen - 0.01, seen + 0.01))

    left, gained = confirmed_scans(LaserFinding(causes, settings=settings), worth)
    assert (left.causes, left.settings, gained) == ((), (), None)


@pytest.mark.parametrize(
    ("nats", "gain", "told"), [(3.0, -1e-4, False), (3.0, 0.02, True), (30.0, -1e-4, True), (3.0, 0.0, True)]
)
def test_little_evidence_must_hold_on_scans_held_out(nats, gain, told):
    """Beside another cause as alone; what is certain must but not lose. Of what acts at edges they say nothing."""
    settings = tuple(EffectSetting(name, {}) for name in ("laser.scale", "laser.offset"))
    faint, sure = Cause("laser.scale", 0.95, {}, nats), Cause("laser.offset", 1.0, {}, 90.0)

    def worth(some):
        seen = 0.5 * ("laser.offset" in {one.id for one in some}) + gain * ("laser.scale" in {one.id for one in some})
        return ChannelGain(LogDensityGain(0.0, seen, seen, seen - 0.01, seen + 0.01))

    left, gained = confirmed_scans(LaserFinding((faint,), settings=settings[:1]), worth)
    assert [cause.id for cause in left.causes] == ["laser.scale"][: int(told)]
    assert (gained is not None) == told
    assert any("do not confirm it" in line for line in left.details) != told
    pictures = Pictures(misfits=tuple(SimpleNamespace(explained_by=one.id) for one in settings))
    left, gained = confirmed_scans(LaserFinding((faint, sure), settings=settings, pictures=pictures), worth)
    assert [one.explained_by for one in left.pictures.misfits] == ["laser.scale", "laser.offset"][1 - told :]
    assert [cause.id for cause in left.causes] == ["laser.scale", "laser.offset"][1 - told :]
    assert gained == worth(left.settings)


@pytest.mark.parametrize(
    ("nats", "battery", "told"), [(2e3, 0.05, ["battery"]), (2e3, -0.05, ["unresolved"]), (30.0, -0.05, [])]
)
def test_a_curve_that_scans_held_out_refuse_gives_way_to_another_or_is_amber(nats, battery, told):
    """By which of two quantities that change alike readings scatter, only scans held out say."""
    time, volts = (Unknown("laser.scatter", name, "bump", 0.9) for name in ("time", "battery"))
    first, other = (EffectSetting(f"smooth.scatter.{one.covariate}", {}) for one in (time, volts))
    gains = {first.id: -0.1, other.id: battery}

    def worth(some):
        seen = sum(gains[one.id] for one in some)
        return ChannelGain(LogDensityGain(0.0, seen, seen, seen - 0.01, seen + 0.01))

    finding = LaserFinding(
        unknown=(time, volts), settings=(first,), nats=nats, stand_ins=(StandIn(volts, other, first.id),)
    )
    left, gained = confirmed_scans(finding, worth)
    assert [one.covariate for one in left.unknown] == told
    assert [one.id for one in left.settings] == [other.id][: battery > 0]
    assert (gained is not None) == (battery > 0)
    verdict = with_scans(replace(bare(), verdict=Verdict("none")), left)
    assert verdict.verdict.verdict == ("unknown" if told else "none")
    assert ("do not say by what: nearest is smooth.scatter.time" in verdict.story.headline) == (told == ["unresolved"])


@pytest.mark.parametrize(("nats", "told"), [(1e3, ["unresolved"]), (30.0, [])])
def test_what_makes_readings_scatter_for_sure_is_amber_where_scans_held_out_refuse_every_name(nats, told):
    setting = EffectSetting("laser.crosstalk", {})
    finding = LaserFinding((Cause(setting.id, 1.0, {}, nats),), settings=(setting,))
    worse = ChannelGain(LogDensityGain(0.0, -0.1, -0.1, -0.11, -0.09))
    left, gained = confirmed_scans(finding, lambda _: worse)
    assert (left.causes, gained) == ((), None)
    assert [one.covariate for one in left.unknown] == told


def test_what_is_right_stays_where_scans_held_out_refuse_another(tmp_path):
    data = scanned(tmp_path, "laser.scale", 0.01, 1, scans=12)
    data = replace(data, test=data.train)
    right, wrong = EffectSetting("laser.scale", {"scale": 0.01}), EffectSetting("laser.quadratic", {"quadratic": 0.02})
    causes = tuple(Cause(each.id, 1.0, {}, 30.0) for each in (right, wrong))
    finding = LaserFinding(causes, (("laser.offset", wrong.id),), settings=(right, wrong))

    left, gained = confirmed_scans(finding, lambda told: scan_gain.measure(data, MODEL, None, told))
    assert (left.causes, left.confounded, left.settings) == (causes[:1], (), (right,))
    assert gained.log_density_per_sample.lo90 > 0
    assert "laser.quadratic explain" in left.details[-1]
