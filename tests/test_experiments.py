# SPDX-License-Identifier: BSD-3-Clause
"""Scripted experiments: files, reader, paths, space, and who watches over them."""

from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from kurumaisu import experiments, settings
from kurumaisu.errors import Error
from kurumaisu.experiments import Box, Phase, Place, base_limits, load_script, nominal_path, obstructed, samples
from kurumaisu.experiments.supervisor import Progress, Supervisor, read_care
from kurumaisu.experiments.visit import Visit
from kurumaisu.params import load_model, shipped
from kurumaisu.world import load_world

CARE = read_care(settings.load(shipped("launch/experiment_node.yaml")))
CONTRACT = [
    "standstill",
    "steering_sweep",
    "straight_three_speeds",
    "spin_both_ways",
    "spin_three_speeds",
    "circles_slow_fast",
    "forward_reverse_turns",
    "steps_big",
    "steps_small",
    "square_wave_w",
    "creep",
    "reversal_from_turns",
    "there_and_back",
    "wall_five_distances",
    "wall_yawed",
    "room_poses",
    "warmup_static",
]
GOOD = {
    "kind": "drive",
    "good_for": "a test",
    "world": "hall.world",
    "box": {"ahead": 2.0, "behind": 0.5, "left": 0.5, "right": 0.5},
    "limits": {"v_forward": 0.5, "v_reverse": 0.3, "w": 0.2},
    "repeat": 1,
    "phases": [
        {"seconds": 2.0, "v": 0.4, "w": 0.0, "ramp": 1.0},
        {"seconds": 1.0, "v": 0.0, "w": 0.0, "ramp": 0.0},
    ],
}


def script_of(tmp_path, **changes):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}))
    return load_script(path)


@pytest.mark.parametrize("name", CONTRACT)
def test_every_experiment_of_the_contract_fits_its_world_and_the_base(name):
    script = experiments.shipped_script(name)
    world = load_world(shipped(f"worlds/{script.world}"))
    model = load_model(shipped("launch/md100.yaml"))
    walls = obstructed(script.box, world.start, experiments.reach(model.chassis) + CARE.margin, world.obstacles)
    # the places at a wall need the wall; there the chair's outline keeps it apart
    assert len(walls) == 0 or script.world == "wall.world"
    assert script.good_for
    assert script.seconds > 10
    assert script.kind != "drive" or not any(base_limits().exceeded(*p.target) for p in script.phases)


def test_another_name_is_refused_with_a_list():
    with pytest.raises(Error, match=r"'spin' is not an experiment: did you mean spin_both_ways"):
        experiments.shipped_script("spin")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "dance"}, "kind: must be one of drive, sweep, places"),
        ({"good": 1}, "good: is not a known key"),
        ({"phases": []}, "phases: must name at least one phase"),
        ({"phases": GOOD["phases"][:1]}, "phases: must end at rest"),
        ({"phases": [{"seconds": 0.5, "v": 0.0, "w": 0.0, "ramp": 1.0}]}, "ramp: takes longer than the phase"),
        ({"phases": [{"seconds": 1.0, "v": 0.0, "ramp": 0.0}]}, r"phases\[0\].w: is missing"),
        ({"phases": [{"seconds": float("nan"), "v": 0.0, "w": 0.0, "ramp": 0.0}]}, "seconds: must be a finite number"),
        ({"limits": {"v_forward": 0.3, "v_reverse": 0.3, "w": 0.2}}, "limits: are exceeded by the phase v 0.4, w 0"),
        ({"repeat": 10}, r"box: is left at x"),
        ({"kind": "places"}, "places: is missing"),
        ({"box": {"ahead": 2.0}}, "box.behind: is missing"),
    ],
)
def test_a_bad_script_is_refused(tmp_path, changes, words):
    with pytest.raises(Error, match=words) as raised:
        script_of(tmp_path, **changes)
    assert "mine.yaml" in str(raised.value)


def test_samples_hold_steps_and_ramps():
    rows = samples((Phase(1.0, (0.4, 0.0), 0.5), Phase(1.0, (0.4, -0.2), 0.0), Phase(0.5, (0.0, 0.0), 0.0)), 0.1)
    assert rows[:, 0] == pytest.approx(np.arange(26) * 0.1)
    assert rows[:6, 1] == pytest.approx([0.0, 0.08, 0.16, 0.24, 0.32, 0.4])
    assert rows[9, 2] == 0.0
    assert rows[10, 2] == pytest.approx(-0.2)  # from t = 1.0 on
    assert rows[19, 1:] == pytest.approx([0.4, -0.2])
    assert rows[20:, 1:] == pytest.approx(0.0)


def test_the_nominal_path_is_an_arc():
    v, w, seconds = 0.3, 0.5, 4.0
    end = nominal_path((Phase(seconds, (v, w), 0.0),))[-1]
    assert end == pytest.approx([v / w * np.sin(w * seconds), v / w * (1 - np.cos(w * seconds)), w * seconds])


def test_space_agrees_with_points_along_the_walls():
    rng = np.random.default_rng(5)
    box, margin = Box(ahead=2.0, behind=1.0, left=0.5, right=1.5), 0.4
    start = np.array([1.0, -2.0, 0.7])
    walls = rng.uniform(-5, 5, (400, 4))
    walls[:40, 2] = walls[:40, 0]  # upright ones
    part = np.linspace(0, 1, 4001)[:, np.newaxis]
    c, s = np.cos(start[2]), np.sin(start[2])

    def reaches_in(wall):
        x, y = (wall[:2] + part * (wall[2:] - wall[:2]) - start[:2]).T
        ahead, left = c * x + s * y, -s * x + c * y
        return np.any((ahead > -1.4) & (ahead < 2.4) & (left > -1.9) & (left < 0.9))

    expected = np.array([reaches_in(wall) for wall in walls])
    assert 40 < expected.sum() < 360
    assert np.array_equal(obstructed(box, start, margin, walls), walls[expected])
    square = np.array([[0.0, 3.0, 1.0, 3.0], [0.0, 0.0, 1.0, 0.0]])  # parallel to the box: outside, inside
    assert np.array_equal(obstructed(box, np.zeros(3), margin, square), square[1:])


@pytest.fixture
def run(tmp_path):
    """Return a supervised script with its clock: go(seconds, pose) ticks every 10 ms and returns what was published."""
    script = script_of(tmp_path)
    supervisor = Supervisor(script, CARE, ["ground_truth", "odom"], lambda _pose: "")
    state = SimpleNamespace(supervisor=supervisor, script=script, now=100.0, mute=set())

    def go(seconds, pose=(0.0, 0.0, 0.0)):
        said = []
        for _ in range(round(seconds * 100)):
            state.now += 0.01
            for source in {"ground_truth", "odom"} - state.mute:
                supervisor.see(source, state.now, np.array(pose, dtype=float))
            out = supervisor.tick(state.now)
            if out is not None:
                said.append((state.now, *out))
        return np.array(said).reshape(-1, 3)

    state.go = go
    return state


def stopped(run, why):
    """Assert that zero is published for a while, then nothing."""
    said = run.go(3.0)
    assert run.supervisor.outcome == why
    assert run.supervisor.stage is Progress.ENDED
    assert not said[:, 1:].any()
    assert CARE.stop_time - 0.12 < said[-1, 0] - said[0, 0] <= CARE.stop_time
    assert len(run.go(1.0)) == 0


def test_it_publishes_the_script_at_a_steady_rate_then_zero_then_nothing(run):
    assert len(run.go(CARE.rest_time - 0.05)) == 0
    said = run.go(6.0)
    assert np.diff(said[:, 0]) == pytest.approx(1 / CARE.rate)
    assert len(said) == round((CARE.lead_time + run.script.seconds + CARE.stop_time) * CARE.rate)
    expected = samples(run.script.phases, 1 / CARE.rate)
    lead = round(CARE.lead_time * CARE.rate)
    assert not said[:lead, 1:].any()  # who has not let go is not obeyed
    assert said[lead : lead + len(expected), 1:] == pytest.approx(expected[:, 1:])
    assert run.supervisor.stage is Progress.ENDED
    assert run.supervisor.outcome == ""


def test_it_does_not_begin_while_the_chair_moves(run):
    said = []
    for i in range(110):
        said.extend(run.go(0.1, (0.05 * i, 0.0, 0.0)))
    assert said == []
    assert run.supervisor.outcome == "the chair does not stand"


@pytest.mark.parametrize("lost", ["ground_truth", "odom"])
def test_it_does_not_begin_without_poses(run, lost):
    run.mute = {lost}
    assert len(run.go(12.0)) == 0
    assert run.supervisor.outcome == f"no poses on {lost}"


@pytest.mark.parametrize("lost", ["ground_truth", "odom"])
def test_lost_poses_stop_it(run, lost):
    run.go(2.0)
    run.mute = {lost}
    said = run.go(0.45)
    assert said[-1, 1] > 0
    run.go(0.1)
    stopped(run, f"poses on {lost} are lost")


def test_leaving_the_box_stops_it(run):
    run.go(2.0)
    assert run.go(0.2, (1.99, 0.49, 0.0))[-1, 1] > 0
    run.supervisor.see("odom", run.now, np.array([9.0, 9.0, 0.0]))  # odometry drifts: the reference decides
    assert run.supervisor.outcome == ""
    run.supervisor.see("ground_truth", run.now, np.array([1.0, 0.51, 0.0]))
    stopped(run, "the chair left the box of the experiment")


def test_poses_that_are_not_numbers_do_not_count(run):
    run.go(2.0)
    run.go(0.6, (np.nan, 0.0, 0.0))
    assert run.supervisor.outcome == "poses on ground_truth, odom are lost"


def test_the_box_is_seen_from_where_it_began(tmp_path):
    supervisor = Supervisor(script_of(tmp_path), CARE, ["ground_truth"], lambda _pose: "")
    begin = np.array([5.0, 5.0, np.pi / 2])
    for i in range(200):
        supervisor.see("ground_truth", 0.01 * i, begin)
        supervisor.tick(0.01 * i)
    assert supervisor.stage is Progress.RUNNING
    supervisor.see("ground_truth", 2.0, np.array([5.0, 6.9, np.pi / 2]))
    assert supervisor.stage is Progress.RUNNING
    supervisor.see("ground_truth", 2.0, np.array([5.6, 5.0, np.pi / 2]))
    assert supervisor.outcome == "the chair left the box of the experiment"


def test_nothing_is_published_while_time_stands(run):
    run.go(2.0)
    assert all(run.supervisor.tick(run.now) is None for _ in range(1000))
    assert run.supervisor.stage is Progress.RUNNING
    assert run.go(0.1)[0, 1] > 0


def test_no_phase_begins_before_the_chair_obeys(run):
    def rates(seconds, heard):
        out = []
        for _ in range(round(seconds * 100)):
            run.now += 0.01
            for source in ("ground_truth", "odom"):
                run.supervisor.see(source, run.now, np.zeros(3))
            out.append(run.supervisor.tick(run.now, heard=heard))
        return [said for said in out if said is not None]

    deaf = rates(CARE.rest_time + 5.0, heard=False)
    assert deaf
    assert not np.any(deaf)
    assert np.any(rates(CARE.lead_time + 3.0, heard=True))


def test_a_chair_that_never_obeys_is_given_up(run):
    for _ in range(round(300 * (2 * CARE.patience + 5))):
        run.now += 0.01
        for source in ("ground_truth", "odom"):
            run.supervisor.see(source, run.now, np.zeros(3))
        run.supervisor.tick(run.now, heard=False)
    assert "nobody obeys" in run.supervisor.outcome


@pytest.mark.parametrize(("leap", "why"), [(5.0, "time jumped by 5.01 s"), (-5.0, "time ran backwards")])
def test_a_clock_that_jumps_stops_it(run, leap, why):
    run.go(2.0)
    run.now += leap
    run.go(0.01)
    stopped(run, why)


def test_being_told_to_stop_stops_it(run):
    run.go(2.0)
    run.supervisor.stop("interrupted")
    stopped(run, "interrupted")


def test_being_told_to_stop_beforehand_publishes_nothing(run):
    run.go(0.5)
    run.supervisor.stop("interrupted")
    assert len(run.go(3.0)) == 0
    assert run.supervisor.outcome == "interrupted"


def test_no_space_refuses_it(tmp_path):
    asked = []
    supervisor = Supervisor(
        script_of(tmp_path), CARE, ["odom"], lambda pose: asked.append(pose) or "not enough space here"
    )
    for i in range(300):
        supervisor.see("odom", 0.01 * i, np.array([3.0, 4.0, 0.5]))
        assert supervisor.tick(0.01 * i) is None
    assert supervisor.outcome == "not enough space here"
    assert np.array_equal(asked, [[3.0, 4.0, 0.5]])


def test_a_visit_wants_the_chair_there_and_at_rest():
    visit = Visit(Place(np.array([1.0, 0.0, np.pi]), 5.0), np.array([0.0, 1.0, np.pi / 2]), CARE)
    assert visit.target == pytest.approx([0.0, 2.0, 1.5 * np.pi])
    for t, pose, expected in (
        (0.0, (0.0, 1.0, np.pi / 2), False),
        (5.0, (0.0, 1.0, np.pi / 2), False),  # at rest, elsewhere
        (6.0, (0.01, 2.0, -np.pi / 2), False),  # just come
        (6.9, (0.01, 2.0, -np.pi / 2), False),
        (7.1, (0.01, 2.0, -np.pi / 2), True),
        (7.2, (0.01, 2.0, -np.pi / 2 + 0.1), False),  # turned away
    ):
        visit.see(t, np.array(pose))
        assert visit.stands(t, t) is expected
