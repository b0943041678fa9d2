# SPDX-License-Identifier: BSD-3-Clause
"""Counters of wheels that overflow are put together again; where they began anew, that is a gap, and said."""

from pathlib import Path

import numpy as np
import pytest
from recordings import Bag

from kurumaisu.critic import Meta, criticise_arrays
from kurumaisu.critic.app.arrays import recording_of
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.odometry import Wheel, Wheels, counted
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.params import robot_of
from kurumaisu.settings import Section

DATA = Path(__file__).resolve().parents[2] / "shared/data"
RADIUS, TRACK, TICKS = 0.05, 0.3, 1000
COUNT = 400


def meta(ticks=TICKS):
    said = {"kind": "diff_drive", "radius": RADIUS, "track": TRACK}
    return Meta(robot=robot_of(Section({"robot": said if ticks is None else said | {"ticks_per_turn": ticks}}, "meta")))


def turned(ticks=TICKS):
    """Return times and what both wheels have counted, whole ticks: ahead, a turn, a stop, and back."""
    t = 0.05 * np.arange(COUNT)
    rates = np.where(t[:, None] < 8, [6.0, 7.0], np.where(t[:, None] < 10, [0.0, 0.0], [-5.0, -3.0]))
    return t, np.round(np.cumsum(rates * 0.05, axis=0) * ticks / (2 * np.pi))


def odom_of(t, counts, said=None):
    table = np.column_stack([t, counts])
    poses = np.column_stack([t, 0.0 * t, 0.0 * t, 0.0 * t])
    recording = recording_of("r", {"one": {"wheels": table, "pose": poses}}, said or meta())
    return recording, recording.runs[0]


def overflown(counts, bits, signed):
    period = 2.0**bits
    return (counts + (period / 2 if signed else 0.0)) % period - (period / 2 if signed else 0.0)


@pytest.mark.parametrize(
    ("bits", "begin", "ticks"), [(8, 250.0, 100), (16, 65_000.0, 1000), (32, 4_294_966_000.0, 1000)]
)
@pytest.mark.parametrize("signed", [False, True])
def test_a_counter_that_overflows_is_put_together_again(bits, begin, ticks, signed):
    t, counts = turned(ticks)
    recording, run = odom_of(t, overflown(counts + begin - (2**bits / 2 if signed else 0), bits, signed), meta(ticks))
    _, whole = odom_of(t, counts, meta(ticks))
    np.testing.assert_allclose(run.odom.values, whole.odom.values, atol=1e-9)
    assert run.aside == ()
    assert recording.invalid == ()
    left, right = recording.problems
    assert left.startswith(f"one/wheels: left: overflows, as it counts to {2**bits:.0f}, ")
    assert right.startswith("one/wheels: right: overflows")


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("ticks", [None, 300])
def test_an_angle_within_a_turn_is_counted_on(signed, ticks):
    t, counts = turned(300)
    angles = counts * 2 * np.pi / 300
    period = 2 * np.pi if ticks is None else 300.0
    given = angles if ticks is None else counts
    within = given % period - (period / 2 if signed else 0.0)
    recording, run = odom_of(t, within, meta(ticks))
    _, whole = odom_of(t, given, meta(ticks))
    np.testing.assert_allclose(run.odom.values, whole.odom.values, atol=1e-9)
    assert all("begins each turn of the wheel anew" in words for words in recording.problems)


def test_a_counter_that_began_anew_is_a_gap_that_is_said():
    """The driver was restarted while the robot stood nowhere near an end of its counter."""
    t, counts = turned()
    anew = counts.copy()
    anew[120:] -= anew[120]
    recording, run = odom_of(t, anew)
    assert run.aside == ((t[119], t[120]),)
    (left, right) = recording.problems
    assert "left: jumps, which is neither an overflow nor motion, once" in left
    assert left.endswith(f"(first: from {counts[119, 0]:.0f} to 0 at t = 6 s): that time is left out")
    assert f"right: jumps, which is neither an overflow nor motion, once (first: from {counts[119, 1]:.0f}" in right
    _, whole = odom_of(t, counts)
    # Until then as it was, and after that the same motion.
    np.testing.assert_allclose(run.odom.values[:120], whole.odom.values[:120], atol=1e-9)
    np.testing.assert_allclose(run.odom.column("v")[121:], whole.odom.column("v")[121:], atol=1e-9)
    np.testing.assert_allclose(
        np.diff(run.odom.column("theta")[120:]), np.diff(whole.odom.column("theta")[120:]), atol=1e-9
    )


def test_the_other_wheel_does_not_turn_the_robot_in_that_gap():
    t, counts = turned()
    counts[120:, 0] -= counts[120, 0]
    _, run = odom_of(t, counts)
    np.testing.assert_array_equal(run.odom.values[120, :3], run.odom.values[119, :3])


def test_a_16_bit_counter_reset_in_its_middle_is_no_overflow():
    t, counts = turned()
    counts = overflown(counts + 40_000, 16, signed=False)
    counts[120:] -= counts[120]
    recording, run = odom_of(t, overflown(counts, 16, signed=False))
    assert run.aside == ((t[119], t[120]),)
    assert [words for words in recording.problems if "neither an overflow nor motion" in words]


def test_a_first_row_before_the_counter_was_read_is_a_gap():
    t, counts = turned()
    counts += 48_213
    counts[:3] = 0.0
    recording, run = odom_of(t, counts)
    assert run.aside == ((t[2], t[3]),)
    assert f"from 0 to {counts[3, 0]:.0f} at t = 0.15 s" in recording.problems[0]


def test_a_step_that_may_go_either_way_is_named_and_not_guessed():
    """Eight bits, and steps of up to 110 of 256: after a row that was lost, 130 ahead are 126 back."""
    t = 0.05 * np.arange(100)
    steps = np.where(np.arange(99) % 2, 90.0, -90.0)
    steps[50] = 130.0
    counts = np.append(0.0, np.cumsum(steps)) % 256
    recording, run = odom_of(t, np.column_stack([counts, counts]), meta(100))
    assert (t[50], t[51]) in run.aside
    assert any("may have turned either way" in words and "t = 2.55 s" in words for words in recording.problems)


def test_a_counter_too_coarse_throughout_forbids_a_verdict():
    t = 0.05 * np.arange(100)
    counts = np.cumsum(np.where(np.arange(100) % 3, 120.0, 100.0)) % 256
    recording, _ = odom_of(t, np.column_stack([counts, counts]), meta(100))
    assert any("left: it is too often not known" in words for words in recording.invalid)


def test_a_jump_faster_than_anything_drives_is_a_gap():
    t, counts = turned()
    counts[200:, 1] += 900_000
    recording, run = odom_of(t, counts)
    assert run.aside == ((t[199], t[200]),)
    assert "right: jumps" in recording.problems[0]


@pytest.mark.parametrize("wheels", [[6.0, 7.0], [0.0, 0.0], [30.0, -30.0]])
def test_wheels_that_only_turn_are_left_as_they_are(wheels):
    rng = np.random.default_rng(1000)
    for scale in (1.0, 0.01):
        t = np.cumsum(rng.choice([0.02, 0.05, 0.4], COUNT) * rng.uniform(0.5, 1.5, COUNT))
        swing = 1 + np.sin(rng.uniform(0.1, 0.5) * t)
        angles = np.cumsum(scale * np.outer(swing, wheels) * np.diff(t, prepend=t[0])[:, None], axis=0)
        for said, counts in ((meta(), np.round(angles * TICKS / (2 * np.pi))), (meta(None), angles)):
            recording, run = odom_of(t, counts, said)
            assert (recording.problems, run.aside) == ((), ())


@pytest.mark.parametrize("given", ["joints", "topics"])
def test_a_bag_s_wheels_count_on_too(tmp_path, given):
    """Four joints, each a counter of its own; the mean of those of a side is taken after they are put together."""
    t, counts = turned()
    starts = {"lf": 65_000, "lr": 100, "rf": 64_000, "rr": 65_500}
    wheels = {
        name: overflown(counts[:, int(name[0] == "r")] + start, 16, signed=False) for name, start in starts.items()
    }
    bag = Bag(tmp_path / "drive.bag")
    for n, at in enumerate(1.0 + t):
        if given == "joints":
            bag.write("/joint_states", bag.joints(at, list(wheels), [row[n] for row in wheels.values()], []), at)
        else:
            for name, row in wheels.items():
                bag.write(f"/{name}", bag.make("std_msgs/msg/Int64", data=int(row[n])), at)
        bag.write("/cmd_vel", bag.twist(0.3, 0.1), at)
    bag.writer.close()
    names = "left: [lf, lr], right: [rf, rr], topic: /joint_states"
    names = names if given == "joints" else "left: [/lf, /lr], right: [/rf, /rr]"
    robot = f"robot: {{kind: diff_drive, radius: {RADIUS}, track: {TRACK}, ticks_per_turn: {TICKS}}}\n"
    (tmp_path / "meta.yaml").write_text(f"{robot}wheels: {{{names}}}\n")
    recording = read_recording(tmp_path)
    _, whole = odom_of(t, counts)
    np.testing.assert_allclose(recording.runs[0].odom.values[:, :3], whole.odom.values[:, :3], atol=1e-6)
    told = [words for words in recording.problems if "overflows" in words]
    assert len(told) == 3  # lr begins far from an end
    assert all(words.startswith("drive.bag wheels: ") for words in told)


def test_the_time_of_a_gap_is_not_fitted():
    """A reset in mid-drive against poses: without the gap set aside, the robot would seem to stand for 4 s."""
    rng = np.random.default_rng(1001)
    t = 0.1 * np.arange(1200)
    v, w = 0.2 + 0.1 * np.sin(0.5 * t), 0.4 * np.sin(0.31 * t)
    theta = np.append(0.0, np.cumsum(0.1 * w[:-1]))
    x, y = (np.append(0.0, np.cumsum(0.1 * v[:-1] * f(theta[:-1] + 0.05 * w[:-1]))) for f in (np.cos, np.sin))
    sides = np.column_stack([v - w * TRACK / 2, v + w * TRACK / 2]) / RADIUS
    counts = np.round(np.vstack([np.zeros((1, 2)), np.cumsum(0.1 * sides[:-1], axis=0)]) * TICKS / (2 * np.pi))
    kept = (t < 60) | (t > 64)
    counts[t > 64] -= counts[t > 64][0]
    pose = np.column_stack([t, np.column_stack([x, y, theta]) + rng.normal(0, 0.002, (len(t), 3))])
    found = criticise_arrays({"one": {"wheels": np.column_stack([t, counts])[kept], "pose": pose}}, meta())
    assert found.verdict.verdict == "none"


def test_the_ticks_of_a_real_rover_are_left_as_they_are():
    path = DATA / "breezyslam_mines/exp1.dat"
    if not path.exists():
        pytest.skip("the real recording breezyslam_mines/exp1.dat is not there")
    rows = np.loadtxt(path)
    recording, run = odom_of(1e-6 * (rows[:, 0] - rows[0, 0]), rows[:, 2:4], meta(2000))
    assert (run.aside, [words for words in recording.problems if "wheels" in words]) == ((), [])


def driven_at_random(rng):
    """Return times with rows missing and late, the angle of a wheel there [rad], and its ticks in a turn."""
    count, step = rng.integers(50, 600), rng.choice([0.01, 0.02, 0.05, 0.1, 0.3])
    t = np.cumsum(step * np.where(rng.random(count) < 0.02, rng.uniform(2, 30, count), rng.uniform(0.3, 1.7, count)))
    knots = np.arange(t[0], t[-1] + 3, rng.uniform(1, 4))
    top = rng.choice([1, 5, 15])
    rates = rng.uniform(-top, top, len(knots)) * (rng.random(len(knots)) < 0.8) + rng.choice([0, top / 2])
    return t, np.cumsum(np.interp(t, knots, rates) * np.diff(t, prepend=t[0])), rng.choice([20, 100, 1000, 4096, 40000])


@pytest.mark.parametrize("kind", [None, 8, 16, 32, "turn"])
def test_no_step_of_any_counter_is_read_wrong(kind):
    """If no step is above 0.3 of the range; few are left out, where rows are missing."""
    rng = np.random.default_rng(1002)
    steps = lost = 0
    for _ in range(120):
        t, angle, ticks = driven_at_random(rng)
        counts = np.round(angle * ticks / (2 * np.pi))
        size = {None: np.inf, "turn": float(ticks)}.get(kind) or 2.0**kind
        if np.abs(np.diff(counts)).max() > 0.3 * size:
            continue
        given = counts if kind is None else (counts + rng.integers(size)) % size
        given = np.where((given >= size / 2) & (rng.random() < 0.5), given - size, given)
        wheels = Wheels(("left",), ("right",), radius=0.1, track=0.5, ticks_per_turn=ticks)
        read, spans = counted(wheels, Wheel("left", t, given), Faults())
        unknown = np.isin(t[:-1], [start for start, _ in spans])
        np.testing.assert_allclose(np.diff(read)[~unknown], np.diff(counts)[~unknown], atol=1e-6)
        steps, lost = steps + len(unknown), lost + unknown.sum()
    assert steps > 5000
    assert lost <= 0.003 * steps
