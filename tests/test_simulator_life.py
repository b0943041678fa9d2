# SPDX-License-Identifier: BSD-3-Clause
"""Repeatability, saved states, and models that come and go."""

import hashlib
import math
import os
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sim_worlds import LASER, OPTIONS, ROOM, drive, robot, simulator

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim import Observation, Simulator
from kurumaisu.sim.options import OdometryWalk
from kurumaisu.sim.robots import state
from kurumaisu.sim.sensors.settings import SensorSettings, load_sensors
from kurumaisu.world import load_world

NOISY = LASER.replace("fov 180", "fov 180 noise [0.0004 0.01 0.5]")
WALK = OdometryWalk(distance=0.01, heading_per_metre=0.01, heading_per_radian=0.01)
CROWD = ROOM + "".join(
    robot(f'name "r{i}" localization "odom" update_interval {100 + 100 * (i % 2)} {NOISY}', f"0 {i} 0 {40 * i}")
    for i in range(4)
)


def crowd(folder: Path, **options: Any) -> Simulator:
    return simulator(folder, CROWD, odometry_walk=WALK, **options)


def wander(sim: Simulator, steps: int, seed: int = 1) -> Observation:
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        seen = sim.step(rng.uniform(-1.5, 1.5, (len(sim.robots), 3)))
    return seen


def test_a_seed_is_a_run_and_threads_do_not_matter(tmp_path: Path) -> None:
    one, two = crowd(tmp_path, threads=1), crowd(tmp_path, threads=2)
    hashes = []
    for sim, seed in ((one, 7), (two, 7), (two, 7), (two, 8)):
        sim.reset(seed)
        wander(sim, 60)
        hashes.append(sim.state_hash())
    assert hashes[0] == hashes[1] == hashes[2]
    assert hashes[0] != hashes[3]


def test_simulators_side_by_side_do_not_know_of_each_other(tmp_path: Path) -> None:
    sims = [crowd(tmp_path, threads=2) for _ in range(4)]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda sim: wander(sim, 60), sims))
    alone = crowd(tmp_path, threads=1)
    wander(alone, 60)
    assert {sim.state_hash() for sim in sims} == {alone.state_hash()}


def test_what_an_observation_holds_does_not_change(tmp_path: Path) -> None:
    sim = crowd(tmp_path)
    seen = wander(sim, 3)
    kept = state.digest([seen.poses, seen.odometry, seen.velocities, seen.stalled, [s.ranges for s in seen.scans]])
    wander(sim, 5)
    now = state.digest([seen.poses, seen.odometry, seen.velocities, seen.stalled, [s.ranges for s in seen.scans]])
    assert kept == now


def test_a_saved_state_continues_bit_for_bit(tmp_path: Path) -> None:
    sim = crowd(tmp_path)
    wander(sim, 17)
    saved = sim.save()
    seen = wander(sim, 20, seed=2)
    after = sim.state_hash()
    for other in (sim, crowd(tmp_path, threads=1)):
        assert other.load(saved).time == pytest.approx(1.7)
        again = wander(other, 20, seed=2)
        assert other.state_hash() == after
        np.testing.assert_array_equal(again.scans.ranges, seen.scans.ranges)


def test_states_of_another_world_are_refused(tmp_path: Path) -> None:
    saved = crowd(tmp_path).save()
    for other in (simulator(tmp_path, ROOM + robot()), crowd(tmp_path, timing="consistent")):
        with pytest.raises(Error, match=r"belongs to another world than .*t\.world, or to other options"):
            other.load(saved)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (b"", "is no saved state"),
        (b"nonsense", "is no saved state"),
        (b"kurumaisu state 1\n\x80\x04N.", "is of version 1; this program reads and writes version 3"),
        (b"kurumaisu state 4 " + b"0" * 64 + b"\n", "is of version 4"),
        (b"kurumaisu state 3\n{}", "is damaged or cut"),
        (b"kurumaisu state 3 " + b"0" * 64 + b"\n{}", "is damaged or cut"),
    ],
)
def test_other_bytes_are_refused(tmp_path: Path, damage: bytes, message: str) -> None:
    sim = crowd(tmp_path)
    before = sim.state_hash()
    with pytest.raises(Error, match=f"state: .*{message}"):
        sim.load(damage)
    assert sim.state_hash() == before


def sealed(text: str, data: bytes = b"") -> bytes:
    """Return bytes that begin with the digest of the rest, whatever that is."""
    body = text.encode() + b"\n" + data
    return f"kurumaisu state 3 {hashlib.sha256(body).hexdigest()}\n".encode() + body


@pytest.mark.parametrize(
    "text",
    [
        "",
        "3",
        "[" * 100_000,
        '{"a": 1, "b": 2}',
        '{"os.system": {"command": "true"}}',
        '{"Place": {"file": 1}}',
        '{"Place": 3}',
        '{"dict": [[{"dict": []}, 1]]}',
        '{"array": ["|O", [1], 0]}',
        '{"array": ["<f8", [1000000000000], 0]}',
        '{"array": ["<f8", [-1], 0]}',
        '{"array": ["<f8", [1], -8]}',
        '{"array": ["(1000000000,)<f8", [1], 0]}',
        '{"array": ["nonsense", [1], 0]}',
        '{"array": [{}, [1], 0]}',
        '{"number": ["<f8", [2], 0]}',
    ],
)
def test_a_state_that_makes_no_sense_is_refused(text: str) -> None:
    with pytest.raises(Error, match="state: ") as raised:
        state.unpack(sealed(text, bytes(16)))
    assert len(str(raised.value)) < 300


def test_a_state_of_the_right_world_with_other_values_changes_nothing(tmp_path: Path) -> None:
    sim = crowd(tmp_path)
    wander(sim, 3)
    before, known = sim.state_hash(), state.unpack(sim.save())
    for wrong in (
        {"machinery": 3},
        {"machinery": {**known["machinery"], "frames": np.zeros((1, 1))}},
        {"random": ()},
        {"sensors": [1]},
        {"population": 7},
        {"step": "x"},
    ):
        with pytest.raises(Error, match="state: makes no sense here"):
            sim.load(state.pack({**known, **wrong}))
        assert sim.state_hash() == before


def test_values_come_back_as_they_were() -> None:
    array = np.arange(6.0).reshape(2, 3).T
    values = {
        "plain": [None, True, -3, 2**127, 0.1, -0.0, math.inf, "ü\n"],
        "numbers": (np.float64(0.1), np.int64(-1), np.bool_(True)),
        "arrays": [array, array, np.zeros((0, 4)), np.array(3, dtype=np.int32)],
        "keys": {1: "a", (2, "b"): Path("/c")},
    }
    again = state.unpack(state.pack(values))
    assert repr(again) == repr(values)
    assert again["arrays"][0].flags.writeable
    assert state.digest({**again, "keys": 0}) == state.digest({**values, "keys": 0})


def test_every_truncated_state_is_refused(tmp_path: Path) -> None:
    saved = simulator(tmp_path, robot()).save()
    for length in range(0, len(saved) - 1, 7):
        with pytest.raises(Error):
            state.unpack(saved[:length])


def test_what_is_no_value_is_not_saved() -> None:
    for value in (os, eval, object(), np.array([None]), {1, 2}):
        with pytest.raises(TypeError, match="cannot be saved"):
            state.pack({"a": value})


def test_no_file_is_unpickled() -> None:
    """The critic's worker processes are sent pickles by their own parent, through a pipe that nobody else has."""
    source = Path(__file__).resolve().parents[1] / "src/kurumaisu"
    found = [path.relative_to(source).as_posix() for path in source.rglob("*.py") if "pickle" in path.read_text()]
    assert found == ["critic/processes/worker.py"]


def test_reset_positions_resets_positions_only(tmp_path: Path) -> None:
    sim = crowd(tmp_path)
    start = sim.observe()
    before = wander(sim, 15)
    sim.reset_positions()
    after = sim.observe()
    np.testing.assert_array_equal(after.poses, start.poses)
    np.testing.assert_array_equal(after.odometry, before.odometry)
    np.testing.assert_array_equal(after.velocities, before.velocities)
    assert after.time == before.time
    assert not after.stalled.any()


def test_a_robot_is_put_elsewhere(tmp_path: Path) -> None:
    sim = crowd(tmp_path)
    before = wander(sim, 4)
    sim.set_pose("r2", [3, -2, 0, math.pi / 2])
    after = sim.observe()
    np.testing.assert_array_equal(after.poses[2], [3, -2, 0, math.pi / 2])
    np.testing.assert_array_equal(np.delete(after.poses, 2, 0), np.delete(before.poses, 2, 0))
    np.testing.assert_array_equal(after.odometry, before.odometry)
    moved = drive(sim, (0.5, 0, 0), 2)[-1]
    np.testing.assert_allclose(moved.poses[2], [3, -1.9, 0, math.pi / 2], atol=0.16)


def test_a_wall_is_moved_with_what_stands_on_it(tmp_path: Path) -> None:
    shelf = 'model ( name "shelf" pose [3 0 0 0] size [0.2 2 1] model ( pose [0 0 0 0] size [0.2 2 1] ) )'
    sim = simulator(tmp_path, shelf + robot(LASER.replace("ranger (", "ranger ( pose [0 0 1 0]")))
    assert drive(sim, (0.1, 0, 0), 1)[-1].scans[0].ranges[90] == pytest.approx(2.9)
    sim.set_pose("shelf", [-2, 0, 0, 0])
    assert np.isinf(drive(sim, (0.1, 0, 0), 1)[-1].scans[0].ranges).all()
    seen = drive(sim, (-0.5, 0, 0), 60)[-1]
    assert seen.stalled[0]
    assert seen.poses[0, 0] == pytest.approx(-1.9 + 0.2, abs=0.05 + 0.02)  # a step, a cell
    sim.reset(0)
    assert drive(sim, (0.1, 0, 0), 1)[-1].scans[0].ranges[90] == pytest.approx(2.9)


def test_a_mast_is_moved_on_its_robot(tmp_path: Path) -> None:
    mast = 'model ( name "mast" pose [0.1 0 0 0] size [0.1 0.1 1] )'
    sim = simulator(tmp_path, robot(mast, "1 0 0 90") + robot(LASER.replace("ranger (", "ranger ( pose [0 0 0.5 0]")))
    drive(sim, (0.1, 0, 0), 1)
    x, y = sim.observe().poses[0, :2]
    sim.set_pose("mast", [x, y, 0.4, 0])
    sim.set_pose(sim.robots[1], [x - 2, y, 0, 0])
    assert drive(sim, (0, 0, 0), 1)[-1].scans[0].ranges[90] == pytest.approx(2 - 0.05)
    np.testing.assert_allclose(sim.model_poses[1], [x, y, 0.4, 0], atol=1e-12)


def test_a_robot_comes_and_goes(tmp_path: Path) -> None:
    sim = crowd(tmp_path)
    wander(sim, 7)
    before = sim.observe()
    guest = load_world(write(tmp_path, robot(f'name "guest" {NOISY}', "0 0 0 0"))).models
    sim.spawn(guest, [2, -3, 0, 1.0])
    after = sim.observe()
    assert [r.name for r in sim.robots] == ["r0", "r1", "r2", "r3", "guest"]
    np.testing.assert_array_equal(after.poses, [*before.poses, [2, -3, 0, 1.0]])
    np.testing.assert_array_equal(after.odometry[:4], before.odometry)
    for old, new in zip(before.scans, after.scans, strict=False):
        np.testing.assert_array_equal(old.ranges, new.ranges)
        assert (old.time, old.count) == (new.time, new.count)
    assert after.scans[4].count == 0
    saved = sim.save()
    later = wander(sim, 9)
    assert later.scans[4].count == 9
    sim.delete("r1")
    assert [r.name for r in sim.robots] == ["r0", "r2", "r3", "guest"]
    np.testing.assert_array_equal(sim.observe().poses, np.delete(later.poses, 1, 0))
    np.testing.assert_array_equal(sim.observe().odometry, np.delete(later.odometry, 1, 0))
    with pytest.raises(Error, match="model r1: there is none of this name"):
        sim.set_pose("r1", [0, 0, 0, 0])
    hashed = sim.state_hash()
    sim.load(saved)
    assert len(sim.robots) == 5
    wander(sim, 9)
    sim.delete("r1")
    assert sim.state_hash() == hashed
    assert len(sim.reset(0).poses) == 4


def keys_of(sim: Simulator) -> dict[str, int]:
    keys = sim.machinery.population.keys.tolist()
    return {m.name: key for m, key in zip(sim.models, keys, strict=True) if m.name}


def test_what_was_deleted_comes_back(tmp_path: Path) -> None:
    text = (
        'model ( name "table" pose [3 3 0 0] size [1 1 0.5] model ( name "vase" pose [0.2 0 0 0] size [0.1 0.1 0.3] ) )'
    )
    sim = simulator(tmp_path, CROWD + text)
    wander(sim, 5)
    keys = keys_of(sim)
    before = {m.name: pose for m, pose in zip(sim.models, sim.model_poses.tolist(), strict=True) if m.name}
    for name in ("vase", "r1", "table"):
        sim.delete(name)
    with pytest.raises(Error, match=f"model vase: stood on model #{keys['table']}, which is not there"):
        sim.restore("vase")
    for name in (f"#{keys['table']}", "vase", "r1"):
        sim.restore(name)
    after = {m.name: pose for m, pose in zip(sim.models, sim.model_poses.tolist(), strict=True) if m.name}
    assert after == before
    assert keys_of(sim) == keys
    places = {m.name: m.index for m in sim.models}
    assert sim.models[places["vase"]].root == sim.models[places["vase"]].parent == places["table"]
    hashed = sim.state_hash()
    sim.load(sim.save())
    assert sim.state_hash() == hashed
    wander(sim, 3)


def test_no_number_is_given_twice(tmp_path: Path) -> None:
    sim = crowd(tmp_path)
    first = sim.spawn('model ( name "a" )', [3, 3, 0, 0])
    sim.delete(first)
    assert sim.spawn('model ( name "a" )', [3, 3, 0, 0]) != first
    with pytest.raises(Error, match="name 'a': there is a model of this name"):
        sim.restore(first)


def test_a_guest_changes_nothing_for_the_others(tmp_path: Path) -> None:
    alone, visited = simulator(tmp_path, CROWD), simulator(tmp_path, CROWD)
    visited.spawn(load_world(write(tmp_path, "model ( size [1 1 1] )")).models, [100, 0, 0, 0])
    visited.spawn(load_world(write(tmp_path, robot())).models, [100, 5, 0, 0])
    commands = np.random.default_rng(1).uniform(-1, 1, (40, 5, 3))
    for row in commands:
        one, two = alone.step(row[:4]), visited.step(row)
    np.testing.assert_array_equal(one.poses, two.poses[:4])
    np.testing.assert_array_equal(one.odometry, two.odometry[:4])
    visited.delete(len(visited.models) - 1)
    visited.delete(len(visited.models) - 1)
    np.testing.assert_array_equal(alone.step(row[:4]).poses, visited.step(row[:4]).poses)


@pytest.mark.parametrize("pose", [[0, 0, 0], [0, 0, 0, math.nan], [0, math.inf, 0, 0], [1e300, 0, 0, 0], "nowhere"])
def test_poses_that_are_none_are_refused(tmp_path: Path, pose: Any) -> None:
    sim = crowd(tmp_path)
    with pytest.raises(Error, match="pose: must be x, y, z"):
        sim.set_pose("r0", pose)


@pytest.mark.parametrize("name", ["nobody", 99, -1, "r"])
def test_unknown_models_are_named(tmp_path: Path, name: str | int) -> None:
    sim = crowd(tmp_path)
    with pytest.raises(Error, match=f"model (number )?{name}: there is none"):
        sim.delete(name)


def test_names_that_are_several_are_refused(tmp_path: Path) -> None:
    sim = simulator(tmp_path, robot('name "a"') * 2)
    with pytest.raises(Error, match="model a: there are several of this name"):
        sim.delete("a")


def test_all_may_go(tmp_path: Path) -> None:
    sim = simulator(tmp_path, robot(LASER) + ROOM)
    while sim.models:
        sim.delete(0)
        seen = sim.step(np.zeros((len(sim.robots), 3)))
    assert len(seen.scans) == 0
    assert seen.scans.ranges.size == 0
    assert len(sim.reset(0).scans) == 1


def write(folder: Path, text: str) -> Path:
    path = folder / "guest.world"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def sensors() -> tuple[SensorSettings, ...]:
    return load_sensors(shipped("launch/sensors.yaml"))


def test_sensors_are_read_at_their_rates_and_saved(tmp_path: Path, sensors: tuple[SensorSettings, ...]) -> None:
    path = write(tmp_path, "interval_sim 20\n" + CROWD)
    sim = Simulator(load_world(path), OPTIONS, sensors)
    commands = np.random.default_rng(2).uniform(-0.5, 0.5, (40, 4, 3))
    counts = Counter(reading.sensor.name for row in commands for reading in sim.step(row).readings)
    assert counts == {sensor.name: round(0.8 * sensor.rate) for sensor in sensors if 0.8 * sensor.rate >= 1}
    saved = sim.save()
    hashes = []
    for _ in range(2):
        for row in commands:
            sim.step(row)
        hashes.append(sim.state_hash())
        sim.load(saved)
    assert hashes[0] == hashes[1]
    sim.delete("r1")
    seen = sim.step(commands[0, :3]).readings
    assert all(set(reading.robots) == {0, 1, 2} for reading in seen)


def test_a_sensor_on_a_robot_that_is_not_there_is_refused(tmp_path: Path, sensors: tuple[SensorSettings, ...]) -> None:
    path = write(tmp_path, CROWD)
    with pytest.raises(Error, match="the world has no position of this name: nobody"):
        Simulator(load_world(path), OPTIONS, [replace(sensors[0], robot="nobody")])


def test_an_imu_feels_that_a_robot_has_stalled(tmp_path: Path, sensors: tuple[SensorSettings, ...]) -> None:
    path = write(tmp_path, ROOM + robot("", "4.7 0 0 0"))
    imu = next(sensor for sensor in sensors if sensor.name == "imu")
    sim = Simulator(load_world(path), OPTIONS, [imu])
    turn = [drive(sim, (0.5, 0, 0.6), 1)[-1].readings[0].value for _ in range(10)]
    assert sim.observe().stalled[0]
    assert abs(np.asarray(turn[-1].angular_velocity).max()) < 0.1
