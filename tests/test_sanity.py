# SPDX-License-Identifier: BSD-3-Clause
"""Wrong data are recognised, whatever effect the robot has besides; good data with large effects are not wrong."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kurumaisu.bench.critic import drives, sanity, wrong_data, wrong_scans
from kurumaisu.bench.hidden import Ask, make
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.rates import mean_rates as rates
from kurumaisu.critic.sanity import input_match, map_agreement, pose_jumps
from kurumaisu.critic.sanity import rows as sanity_rows
from kurumaisu.critic.sanity.examination import examine
from kurumaisu.critic.values.recording import Series
from kurumaisu.params import load_model, shipped
from kurumaisu.real import warthog

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.mark.parametrize("fault", wrong_data.SPOILT)
def test_wrong_data_are_said_with_what_would_mend_them(fault):
    assert any(wrong_data.SPOILT[fault][1] in line for line in sanity.findings_of(fault, [41]))


def case(effect, size, style="joystick"):
    return drives.Case(style, effect, size, noise=1.0, tau=0.3, pose_sd=0.005, seconds=60.0, rate=10.0)


@pytest.mark.parametrize("effect", drives.EFFECTS)
def test_a_large_effect_is_not_wrong_data(effect):
    largest, signed, _ = drives.EFFECTS[effect]
    for sign in (-1, 1) if signed else (1,):
        tables = drives.make(case(effect, sign * largest), np.random.default_rng(3))
        assert sanity.findings_of_tables(tables, ["command", "voltage", "pose"], None) == []


@pytest.mark.parametrize("style", drives.STYLES)
def test_nothing_is_wrong_with_a_good_drive_of_any_style(style):
    tables = drives.make(case(None, 0.0, style), np.random.default_rng(4))
    assert sanity.findings_of_tables(tables, ["command", "voltage", "pose"], None) == []


@pytest.mark.parametrize(("turns", "crossed", "swapped"), [(0.0, False, False), (0.5, False, False), (0.5, True, True)])
def test_channels_are_swapped_only_if_neither_follows_its_own(turns, crossed, swapped):
    """Of a chair that veers much the yaw rate follows the forward channel, but so does the speed."""
    rng = np.random.default_rng(6)
    t = np.arange(0.0, 120.0, rates.STEP)
    v, w = 0.5 * (t % 10 < 5), turns * (t % 14 < 7)
    driven = np.column_stack([v + rng.normal(0, 0.25, len(t)), w + 0.4 * v + rng.normal(0, 0.06, len(t))])
    asked = np.column_stack([w, v] if crossed else [v, w])
    match = input_match.compare(rates.Rates(t, asked), rates.Rates(t, driven), "command")
    assert any("are swapped" in words for words in match.words) == swapped


@pytest.mark.parametrize(("early", "scale", "words"), [(0.8, 0.0, 1), (0.0, 0.008, 0), (0.0, -0.008, 0), (0.1, 0.0, 0)])
def test_a_clock_that_is_off_from_the_outset_is_no_slow_one(early, scale, words):
    """Later on, a lead of a second may be a clock's pace, which the catalogue has."""
    rng = np.random.default_rng(7)
    t = np.arange(0.0, 240.0, rates.STEP)
    asked = np.repeat(rng.uniform(-0.5, 0.5, (60, 2)), 40, axis=0)
    at = (t + early) * (1 + scale)
    driven = np.column_stack([np.interp(at, t, column) for column in asked.T]) + rng.normal(0, 0.05, asked.shape)
    found = input_match.compare(rates.Rates(t, asked), rates.Rates(t, driven), "command", first=True)
    assert len(found.words) == words
    assert not input_match.compare(rates.Rates(t, asked), rates.Rates(t, driven), "command").words


def test_poses_that_are_missing_are_not_late():
    rng = np.random.default_rng(8)
    tables = drives.make(case(None, 0.0), rng)
    kept = rng.random(len(tables["pose"])) < 0.6
    tables["pose"] = tables["pose"][kept]
    assert sanity.findings_of_tables(tables, ["command", "voltage", "pose"], None) == []


def test_the_warthogs_poses_wait_and_the_rest_of_them_do_not():
    if not (DATA / "norlab_drive").exists():
        pytest.skip("no recordings of norlab_drive")
    log = warthog.load(DATA)
    told = {}
    for name, poses in (("all", log.all_poses), ("kept", log.pose)):
        rows = warthog.between(poses, 134.0, 218.0)
        told[name] = pose_jumps.problem(Series(rows[:, 0], rows[:, 1:], ("x", "y", "theta")))
    assert told["kept"] is None
    assert "times of arrival" in told["all"]


def test_poses_of_another_drive_have_nothing_to_do_with_what_was_asked_for():
    tables, other = (drives.make(case(None, 0.0), np.random.default_rng(seed)) for seed in (7, 8))
    good = sanity.findings_of_tables(tables, ["command", "voltage", "pose"], None)
    tables["pose"] = other["pose"]
    assert good == []
    assert any("nothing to do" in line for line in sanity.findings_of_tables(tables, ["command", "pose"], None))


QUICK = (
    "map shifted",
    "beams reversed",
    "laser at 180 deg",
    "fan in degrees",
    "ranges in cm",
    "stuck",
    "all 0",
    "constant",
)


@pytest.mark.parametrize("fault", QUICK)
def test_wrong_scans_and_maps_are_said(fault):
    """Words may differ where two readings of the data fit alike; that something is wrong must be said."""
    assert sanity.findings_of(fault, [52])


@pytest.mark.parametrize("seed", [53, 54, 74])
def test_a_map_of_which_a_part_is_right_is_said_where_a_quarter_of_it_is_seen_to_be_wrong(seed):
    assert sanity.findings_of("map before the house was rebuilt", [seed])


@pytest.mark.parametrize("seed", [61, 62])
def test_good_scans_are_not_wrong(seed):
    assert sanity.findings_of("with scans", [seed]) == []


def exact_drive():
    """A drive with rests, by a reference without any noise, as a simulator's: (t, x, y, theta) and (t, v, w)."""
    phases = [(2.0, 0.0, 0.0)]
    for k in range(8):
        phases += [(3.0, 0.4 if k % 2 else -0.3, 0.2 * (k % 3 - 1)), (2.0 + 0.3 * k, 0.0, 0.0)]
    command = np.array([(sum(p[0] for p in phases[:n]), v, w) for n, (_, v, w) in enumerate(phases)])
    t = np.arange(0.0, sum(p[0] for p in phases), 0.05)
    v, w = command[np.searchsorted(command[:, 0], t + 1e-9, side="right") - 1, 1:].T
    theta = np.r_[0.0, np.cumsum(0.05 * w)[:-1]]
    x, y = (np.r_[0.0, np.cumsum(0.05 * v * of(theta + 0.025 * w))[:-1]] for of in (np.cos, np.sin))
    return {"pose": np.column_stack([t, x, y, theta]), "command": command}


def test_a_robot_that_rests_under_an_exact_reference_is_not_wrong():
    assert sanity.findings_of_tables(exact_drive(), ["command", "pose"], None) == []


def test_poses_that_are_held_while_it_moves_are_said_beside_rests():
    tables = exact_drive()
    poses = tables["pose"]
    again = np.flatnonzero(np.random.default_rng(2).random(len(poses) - 1) < 0.15) + 1
    tables["pose"][again, 1:] = poses[again - 1, 1:]
    assert any("duplicate rows" in line for line in sanity.findings_of_tables(tables, ["command", "pose"], None))


def test_the_lag_of_white_noise_behind_itself_is_found():
    rng = np.random.default_rng(1)
    a = rng.normal(size=2000)
    found = rates.shift_correlation(np.roll(a, 7), a, (0.01, 0.01), 5.0)
    at = int(np.argmax(found.nats))
    assert found.lags[at] == pytest.approx(0.7)
    assert found.correlation[at] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("step", "found"), [(0.25, 0.25), (0.05, 0.05), (None, 0.0)])
def test_the_grid_of_numbers_is_found(step, found):
    values = np.random.default_rng(2).normal(size=5000)
    on_grid = values if step is None else np.round(values / step) * step
    assert sanity_rows.grid_of(on_grid) == pytest.approx(found, rel=1e-3)


def test_a_map_is_moved_back_to_where_the_points_are():
    rng = np.random.default_rng(5)
    walls = wrong_scans.place(rng, np.zeros(2))
    ends = walls.reshape(-1, 2)
    points = np.concatenate([a + rng.random((20, 1)) * (b - a) for a, b in ends.reshape(-1, 2, 2)])
    c, s = np.cos(0.7), np.sin(0.7)
    moved = (ends @ np.array([[c, s], [-s, c]]) + [3.0, -1.0]).reshape(-1, 4)
    fitted = next(map_agreement.nearest_maps(points, moved))
    assert np.abs(fitted.segments - walls).max() < 0.05


def test_rows_that_repeat_a_stretch_are_found_and_standing_still_is_not():
    rng = np.random.default_rng(6)
    rows = rng.normal(size=(100, 3))
    rows[30:60] = rows[30]  # rest
    series = Series(np.arange(100) / 10, rows, ("x", "y", "theta"))
    assert sanity_rows.blocks(series, "pose") is None
    rows[80:95] = rows[5:20]
    assert "15 rows from t = 8 s on equal those from t = 0.5 s on" in sanity_rows.blocks(series, "pose")


def test_a_run_that_is_another_one_once_more_is_said():
    rng, marks = np.random.default_rng(7), sanity_rows.marks
    rows = np.cumsum(rng.normal(size=(60, 3)), axis=0)
    pose, later = (Series(np.arange(60) / 10 + start, rows, ("x", "y", "theta")) for start in (0.0, 100.0))
    assert sanity_rows.copied(marks(later), marks(pose))
    again = Series(pose.t, rows + 1e-6 * rng.normal(size=rows.shape), pose.columns)
    assert not sanity_rows.copied(marks(again), marks(pose))
    still = Series(pose.t, np.tile(rows[:1], (60, 1)), pose.columns)
    assert not sanity_rows.copied(marks(still), marks(still))


def test_nothing_is_wrong_with_a_real_bag():
    name = "scan_tools/demo.bag"
    if not (DATA / name).is_file():
        pytest.skip(f"{DATA / name} is not there")
    recording = read_recording(DATA / name)
    assert recording.invalid == ()
    assert examine(recording, load_model(shipped("launch/md100.yaml"))).invalid == []


@pytest.mark.parametrize("fault", ["scan mirrored", "wrong map"])
def test_scans_are_compared_with_the_map_though_only_the_model_mounts_the_laser(fault, tmp_path):
    model = load_model(shipped("launch/md100.yaml"))
    made = make(Ask("wrong", (fault,), family="laser"), 34100, tmp_path)
    assert examine(replace(made.recording, laser=None), model).invalid
    assert examine(replace(made.null, laser=None), model).invalid == []


@pytest.mark.parametrize("seed", [36450, 36451])
def test_a_laser_that_is_mounted_a_little_elsewhere_has_no_other_clock(seed, tmp_path):
    """Before one wall, from a few distances, clocks 22 s apart would do as much: 10 and 18 cm."""
    made = make(Ask("confounded", ("laser.mount_x",), design="wall", family="laser"), seed, tmp_path)
    assert examine(made.recording, load_model(shipped("launch/md100.yaml"))).invalid == []


@pytest.mark.parametrize("fault", ["", "another building"])
def test_readings_that_are_cut_off_say_nothing_about_the_map(fault):
    """Two in three are, by a laser that is mounted 3 cm elsewhere, too."""
    rng = np.random.default_rng(9)
    tables = drives.make(case(None, 0.0), rng)
    sight = wrong_scans.look(tables, rng, np.array([0.03, -0.03, 0.0]), 0.005)
    sight = wrong_scans.SPOILT[fault][0](sight, rng) if fault else sight
    cut = np.nanquantile(sight.scans[:, 1:], 0.35)
    sight = replace(sight, scans=np.column_stack([sight.scans[:, 0], np.minimum(sight.scans[:, 1:], cut)]))
    assert bool(sanity.findings_of_tables(tables, ["command", "pose"], sight)) == bool(fault)
