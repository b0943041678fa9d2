# SPDX-License-Identifier: BSD-3-Clause
"""`robot:` in meta.yaml: what is refused, what a robot without voltages cannot have, and what its wheels ask for."""

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.critic import Meta, criticise_arrays, read_recording, write
from kurumaisu.critic.app.arrays import recording_of
from kurumaisu.critic.base.replay import model_of
from kurumaisu.critic.data.meta import read_meta
from kurumaisu.critic.engine.catalogue import catalogue
from kurumaisu.critic.experiment.design import possible
from kurumaisu.critic.experiment.rehearse import rehearse
from kurumaisu.critic.values.verdict import verdict_text
from kurumaisu.errors import Error
from kurumaisu.experiments import shipped_script
from kurumaisu.params import Robot, driven_as, load_model, robot_of, shipped, shipped_robot
from kurumaisu.programs import sim
from kurumaisu.settings import Section
from kurumaisu.sim.plant import Plant

MODEL = shipped("launch/md100.yaml")
WHEELS = {"kind": "diff_drive", "radius": 0.05, "track": 0.3}
ALL = ("md100", "velocity", "diff_drive", "skid_steer")


def robot(**said) -> Robot:
    return robot_of(Section({"robot": said}, "meta.yaml"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("robot: dif_drive", "robot.kind: there is no robot 'dif_drive'; did you mean diff_drive?"),
        ("robot: tank", "robot.kind: there is no robot 'tank'; there are: diff_drive, md100, skid_steer, velocity"),
        ("robot: diff_drive", "robot.radius: is missing"),
        ("robot: {kind: skid_steer, radius: 0.1}", "robot.track: is missing"),
        ("robot: {radius: 0.1, track: 0.5}", "robot.kind: is missing"),
        ("robot: {kind: diff_drive, radius: 0, track: 0.5}", "robot.radius: must be a finite number above 0: 0"),
        ("robot: {kind: diff_drive, radius: 0.1, track: .nan}", "robot.track: must be a finite number above 0"),
        ("robot: {kind: velocity, radius: 0.1}", "robot.radius: is not a known key"),
        ("robot: {kind: md100, ticks_per_turn: 9}", "robot.ticks_per_turn: is not a known key"),
        ("robot: {kind: velocity, fastest: {v: 1.0}}", "robot.fastest.w: is missing"),
        ("robot: {kind: velocity, fastest: {v: -1.0, w: 1}}", "robot.fastest.v: must be a finite number above 0"),
        ("robot: 3", "robot: must be a mapping, not int 3"),
        ("robot: []", "robot: must be a mapping"),
        ("robot: ../mine.yaml", "robot.kind: must be a file in the recording's folder"),
        ("robot: gone.yaml", "gone.yaml"),
        ("robot: {kind: mine.yaml, track: 1.0}", "robot.track: is not a known key"),
    ],
)
def test_what_no_robot_is_says_where_it_stands(tmp_path, text, words):
    (tmp_path / "mine.yaml").write_text("kind: velocity\n")
    (tmp_path / "meta.yaml").write_text(text)
    with pytest.raises(Error) as refused:
        read_meta(tmp_path / "meta.yaml")
    assert words in str(refused.value)
    assert str(tmp_path) in str(refused.value)


def test_a_fault_in_a_robot_of_ones_own_names_its_file(tmp_path):
    (tmp_path / "meta.yaml").write_text("robot: mine.yaml")
    (tmp_path / "mine.yaml").write_text("{kind: diff_drive, radius: 0.1, track: 0.5, weels: 4}")
    with pytest.raises(Error, match=r"mine\.yaml: weels: is not a known key"):
        read_meta(tmp_path / "meta.yaml")
    (tmp_path / "mine.yaml").write_text("{kind: diff_drive, radius: 0.1, track: 0.5}")
    assert read_meta(tmp_path / "meta.yaml").robot == robot(kind="diff_drive", radius=0.1, track=0.5)


def test_every_shipped_robot_is_one():
    assert sorted(ALL) == sorted(path.stem for path in shipped("launch/robots").glob("*.yaml"))
    for kind in ALL:
        sizes = {"radius": 0.1, "track": 0.5} if kind in ("diff_drive", "skid_steer") else {}
        assert robot(kind=kind, **sizes).kind == kind


def test_wheels_need_not_be_said_twice(tmp_path):
    meta = tmp_path / "meta.yaml"
    meta.write_text("{robot: {kind: diff_drive, radius: 0.1, track: 0.5}, wheels: {left: /l, right: /r}}")
    wheels = read_meta(meta).wheels
    assert (wheels.radius, wheels.track) == (0.1, 0.5)
    meta.write_text("{robot: velocity, wheels: {left: /l, right: /r}}")
    with pytest.raises(Error, match=r"wheels\.radius: is missing"):
        read_meta(meta)


def turned(count=400):
    """Return times, angles of both wheels [rad], and the poses of a robot whose wheels of WHEELS turned so far."""
    t = 0.05 * np.arange(count)
    left, right = 4.0 * t + np.sin(t), 5.0 * t - np.sin(0.7 * t)
    fine = np.linspace(0.0, t[-1], 40 * (count - 1) + 1)
    a, b = 4.0 * fine + np.sin(fine), 5.0 * fine - np.sin(0.7 * fine)
    theta = (b - a) * WHEELS["radius"] / WHEELS["track"]
    way = np.diff((a + b) / 2 * WHEELS["radius"])
    middle = (theta[1:] + theta[:-1]) / 2
    x, y = (np.append(0.0, np.cumsum(way * f(middle)))[::40] for f in (np.cos, np.sin))
    return t, np.column_stack([left, right]), np.column_stack([x, y, theta[::40]])


@pytest.mark.parametrize("ticks", [None, 4096.0])
def test_wheels_by_angle_or_tick_are_odometry(tmp_path, ticks):
    t, angles, poses = turned()
    said = WHEELS if ticks is None else WHEELS | {"ticks_per_turn": ticks}
    table = np.column_stack([t, angles if ticks is None else angles * ticks / (2 * np.pi)])
    np.savetxt(tmp_path / "wheels.csv", table, delimiter=",", header="t,left,right", comments="")
    np.savetxt(tmp_path / "pose.csv", np.column_stack([t, poses]), delimiter=",", header="t,x,y,theta", comments="")
    (tmp_path / "meta.yaml").write_text(f"robot: {said}".replace("'", ""))
    (run,) = read_recording(tmp_path).runs
    assert np.abs(run.odom.values[:, :3] - poses).max() < 1e-3
    as_arrays = recording_of(
        "r", {tmp_path.name: {"wheels": table, "pose": poses_at(t, poses)}}, Meta(robot=robot(**said))
    )
    assert np.allclose(as_arrays.runs[0].odom.values, run.odom.values)


def poses_at(t, poses):
    return np.column_stack([t, poses])


def test_wheels_by_rate_are_odometry():
    t, _, poses = turned()
    rates = np.column_stack([t, 4.0 + np.cos(t), 5.0 - 0.7 * np.cos(0.7 * t)])
    recording = recording_of(
        "r", {"one": {"wheel_rates": rates, "pose": poses_at(t, poses)}}, Meta(robot=robot(**WHEELS))
    )
    assert np.abs(recording.runs[0].odom.values[:, :3] - poses).max() < 2e-3


@pytest.mark.parametrize(
    ("said", "more", "words"),
    [
        (None, {}, "one/wheels: how large the wheels are is not said"),
        (shipped_robot("velocity"), {}, "one/wheels: how large the wheels are is not said"),
        (robot(**WHEELS), {"odom": np.zeros((2, 4))}, "one/wheels: is odometry, and so is odom"),
        (robot(**WHEELS), {"wheel_rates": np.ones((2, 3))}, "one/wheels: is odometry, and so is wheel_rates"),
    ],
)
def test_wheels_of_no_known_size_or_beside_other_odometry_are_refused(said, more, words):
    t, angles, _ = turned(10)
    more = {name: np.column_stack([[0.0, 1.0], table[:, 1:]]) for name, table in more.items()}
    with pytest.raises(Error, match=words):
        recording_of("r", {"one": {"wheels": np.column_stack([t, angles]), **more}}, Meta(robot=said))


def tables(rates, seconds=8.0):
    """Return tables of a drive at rates (n, 2), each held for so long [s], that did what it was asked."""
    t = np.arange(len(rates)) * seconds
    times = np.arange(0.0, len(rates) * seconds, 0.1)
    v, w = np.asarray(rates)[(times // seconds).astype(int)].T
    theta = np.append(0.0, np.cumsum(w[:-1])) * 0.1
    x, y = (np.append(0.0, np.cumsum((v * f(theta + 0.05 * w))[:-1])) * 0.1 for f in (np.cos, np.sin))
    noise = np.random.default_rng(1).normal(0.0, 0.002, (len(times), 3))
    pose = np.column_stack([times, np.column_stack([x, y, theta]) + noise])
    return {"command": np.column_stack([t, rates]), "pose": pose}


SLOW = [(0.1, 0.0), (0.0, 0.3), (0.1, -0.2), (-0.05, 0.1)]


def test_a_slow_robot_is_no_md100_where_it_says_so():
    said = criticise_arrays({"drive": tables(SLOW)}, Meta(robot=shipped_robot("velocity")), only=["base.gain_v"])
    assert said.model.name == "velocity follows command"
    assert (said.verdict.robot.kind, said.verdict.robot.assumed) == ("velocity", False)
    assert "chair" not in " ".join([said.story.headline, *said.story.details])
    guessed = criticise_arrays({"drive": tables(SLOW)}, only=["base.gain_v"])
    assert (guessed.verdict.robot.kind, guessed.verdict.robot.assumed) == ("md100", True)
    assert any("`robot:` in meta.yaml, or --robot, says" in detail for detail in guessed.story.details)


def test_a_fast_one_that_says_nothing_is_taken_for_another_make():
    found = criticise_arrays({"drive": tables([(3.0, 0.0), (0.0, 0.5), (2.0, 0.4)])}, only=["base.gain_v"])
    assert (found.verdict.robot.kind, found.verdict.robot.assumed) == ("velocity", True)


def test_an_md100_that_says_so_keeps_its_law_however_fast():
    fast = {"drive": tables([(3.0, 0.0), (0.0, 0.5), (2.0, 0.4)])}
    found = criticise_arrays(fast, Meta(robot=shipped_robot("md100")), only=["base.gain_v"])
    assert found.model.law_name == "published"
    assert not found.verdict.robot.assumed


def test_voltages_of_a_robot_that_has_none_are_refused():
    drive = tables(SLOW) | {"voltage": [[0.0, 0.2, 0.0], [8.0, 0.0, 0.2]]}
    with pytest.raises(Error, match="robot: velocity has no voltages, but voltages of drive are given"):
        criticise_arrays({"drive": drive}, Meta(robot=shipped_robot("velocity")))


def test_without_voltages_nothing_that_acts_on_them_is_looked_for():
    chair = load_model(MODEL)
    other = driven_as(chair, shipped_robot("velocity"))
    ids = [{term.id for term in catalogue(model)} for model in (chair, other)]
    gone = ids[0] - ids[1]
    assert gone == {"base.dac_zero_f", "base.dac_zero_s", "base.dac_quantisation", "base.cross_v_to_w"}
    assert not any(effects.by_id(name).of_voltages for name in ids[1])


def test_drives_are_proposed_that_the_robot_can_drive():
    chair, slow = load_model(MODEL), robot(kind="velocity", fastest={"v": 0.1, "w": 0.2})
    assert possible(shipped_script("steering_sweep"), chair)
    assert not possible(shipped_script("steering_sweep"), driven_as(chair, shipped_robot("velocity")))
    assert possible(shipped_script("steps_big"), driven_as(chair, shipped_robot("velocity")))
    assert not possible(shipped_script("steps_big"), driven_as(chair, slow))


# The robot as it is, wheel by wheel: radii [m] and track [m]; its software has those of WHEELS.
LEFT, RIGHT, TRACK = 0.0515, 0.0521, 0.324


def wheel_drive(rates, seconds, rng=None):
    """Return times and poses of a robot whose wheels are turned as its software would turn them; Euler, 1 ms."""
    v, w = np.repeat(np.asarray(rates), round(seconds / 1e-3), axis=0).T
    left = (v - w * WHEELS["track"] / 2) / WHEELS["radius"] * LEFT
    right = (v + w * WHEELS["track"] / 2) / WHEELS["radius"] * RIGHT
    theta = np.append(0.0, np.cumsum((right - left) / TRACK))[:-1] * 1e-3
    x, y = (np.append(0.0, np.cumsum((left + right) / 2 * f(theta)))[:-1] * 1e-3 for f in (np.cos, np.sin))
    poses = np.column_stack([x, y, theta])[::100]
    if rng is not None:
        poses = poses + rng.normal(0.0, [0.003, 0.003, 0.003], poses.shape)
    return np.arange(len(poses)) * 0.1, poses


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(7)
    drives = {}
    for name in ("one", "two"):
        rates = np.column_stack([rng.uniform(-0.3, 0.4, 12), rng.uniform(-0.8, 0.8, 12)])
        t, poses = wheel_drive(rates, 5.0, rng)
        drives[name] = {
            "command": np.column_stack([5.0 * np.arange(12), rates]),
            "pose": np.column_stack([t, poses]),
        }
    return criticise_arrays(drives, Meta(robot=robot(**WHEELS), truth=(0.003, 0.003)), only=["base.[glv]*"])


def test_multipliers_are_those_of_the_wheels(found):
    m = found.verdict.robot.multipliers
    truths = {
        "left_wheel_radius_multiplier": LEFT / WHEELS["radius"],
        "right_wheel_radius_multiplier": RIGHT / WHEELS["radius"],
        "wheel_radius_multiplier": (LEFT + RIGHT) / 2 / WHEELS["radius"],
        "wheel_separation_multiplier": TRACK / WHEELS["track"],
        "apparent_track": TRACK,
    }
    for name, truth in truths.items():
        e = getattr(m, name)
        assert abs(e.estimate - truth) < 2 * (e.hi90 - e.lo90), name
        assert e.hi90 - e.lo90 < 0.02, name


def test_the_square_closes_better_as_an_independent_one_does(found):
    m = found.verdict.robot.multipliers
    names = ("wheel_separation", "left_wheel_radius", "right_wheel_radius")
    s, left, right = (getattr(m, f"{name}_multiplier").estimate for name in names)

    def square(s, left, right):
        ends = []
        for side in (1.0, -1.0):
            corner = [(0.2, 0.0)] * 20 + [(0.0, side * np.pi / 4)] * 2
            v, w = np.array(corner * 4).T
            sides = (v - w * WHEELS["track"] * s / 2) / left, (v + w * WHEELS["track"] * s / 2) / right
            rates = np.column_stack([(sides[1] + sides[0]) / 2, (sides[1] - sides[0]) / WHEELS["track"]])
            ends.append(np.hypot(*wheel_drive([*rates, (0.0, 0.0)], 1.0)[1][-1, :2]))
        return max(ends)

    assert m.square_before == pytest.approx(square(1.0, 1.0, 1.0), rel=0.1)
    assert square(s, left, right) < 2 * m.square_after
    assert m.square_after < 0.2 * m.square_before


def test_what_was_found_of_wheels_can_be_pasted_read_and_run(found, tmp_path):
    write(found, MODEL, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "wheel_separation_multiplier: 1.0" in page
    assert "left_wheel_radius_multiplier: 1.0" in page
    assert "chair" not in found.story.headline
    assert (tmp_path / "verdict.json").read_text() == verdict_text(found.verdict)
    extended = load_model(tmp_path / "extended.yaml")
    assert extended.robot == robot(**WHEELS)
    assert extended.chassis.track == WHEELS["track"]
    moved = Plant(extended, 0.01, np.random.default_rng(0)).from_rates(np.full(2000, 0.3), np.zeros(2000), 0.0, {})
    assert moved.v[-500:].mean() == pytest.approx(0.3 * (LEFT + RIGHT) / 2 / WHEELS["radius"], abs=0.01)
    curved = 0.3 * (RIGHT - LEFT) / WHEELS["radius"] / TRACK
    assert moved.w[-500:].mean() == pytest.approx(curved, abs=0.01)


def command_drives(changed, seed):
    """Return two drives of a robot with the wheels that its software has, asked for rates that are changed (n, 2)."""
    rng = np.random.default_rng(seed)
    drives = {}
    for name in ("one", "two"):
        rates = np.column_stack([rng.uniform(-0.3, 0.4, 12), rng.uniform(-0.8, 0.8, 12)])
        v, w = changed(rates).T
        left, right = (
            (v + side * w * TRACK / 2) * WHEELS["radius"] / radius for side, radius in ((-1.0, LEFT), (1.0, RIGHT))
        )
        asked = np.column_stack([(left + right) / 2, (right - left) / WHEELS["track"]])
        t, poses = wheel_drive(asked, 5.0, rng)
        command = np.column_stack([5.0 * np.arange(12), rates])
        drives[name] = {"command": command, "pose": np.column_stack([t, poses])}
    return drives


def test_a_robot_as_its_software_has_it_is_told_to_change_nothing():
    found = criticise_arrays(
        command_drives(lambda rates: rates, 8), Meta(robot=robot(**WHEELS), truth=(0.003, 0.003)), only=["base.[glv]*"]
    )
    assert found.verdict.verdict == "none"
    m = found.verdict.robot.multipliers
    for name in ("wheel_separation", "left_wheel_radius", "right_wheel_radius"):
        e = getattr(m, f"{name}_multiplier")
        assert abs(e.estimate - 1.0) < 2 * (e.hi90 - e.lo90)
    assert m.square_after < 0.1


def test_a_top_speed_is_not_mended_by_wheels():
    found = criticise_arrays(
        command_drives(lambda rates: np.clip(rates, [-0.2, -9.0], [0.2, 9.0]), 9),
        Meta(robot=robot(**WHEELS), truth=(0.003, 0.003)),
        only=["base.[glvs]*"],
    )
    assert [cause.id for cause in found.verdict.causes] == ["base.saturation"]
    e = found.verdict.robot.multipliers.wheel_radius_multiplier
    assert abs(e.estimate - 1.0) < 0.02


def test_the_simulator_runs_it_and_records_no_voltages(found, tmp_path):
    write(found, MODEL, tmp_path / "found")
    extended = tmp_path / "found/extended.yaml"
    drive = ["--model", str(extended), "-v", "0.3", "--seconds", "2", "-o", str(tmp_path / "driven")]
    assert sim.main(drive) == 0
    recording = read_recording(tmp_path / "driven")
    assert recording.robot == robot(**WHEELS)
    assert recording.runs[0].voltage is None
    assert model_of(recording, extended, assume_law=False).robot == robot(**WHEELS)
    with pytest.raises(Error, match="steering_sweep: asks for voltages, and diff_drive has none"):
        rehearse("steering_sweep", extended, None, 1)


def test_an_extended_model_knows_its_robot_again(found, tmp_path):
    write(found, MODEL, tmp_path)
    (tmp_path / "again").mkdir()
    for name, table in tables(SLOW).items():
        header = "t,v,w" if name == "command" else "t,x,y,theta"
        np.savetxt(tmp_path / "again" / f"{name}.csv", table, delimiter=",", header=header, comments="")
    recording = read_recording(tmp_path / "again")
    model = model_of(recording, tmp_path / "extended.yaml", assume_law=True)
    assert model.robot == robot(**WHEELS)
