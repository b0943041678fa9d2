# SPDX-License-Identifier: BSD-3-Clause
"""The chair among things that move: it pushes, is stopped, and its laser sees them at the time of each beam."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Model, load_model, shipped
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command, Observation
from kurumaisu.sim.sensors.settings import load_sensors
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.world import load_world

MODEL = load_model(shipped("launch/md100.yaml"))
DYNAMICS = load_dynamics(shipped("launch/physical.yaml"))
FRONT, WIDTH, MASS = MODEL.chassis.axle_to_front, MODEL.chassis.width, MODEL.chassis.mass
GRAVITY, FLOOR, WHEELS = 9.81, 0.5, 0.8  # the frictions of launch/physical.yaml
LAW = type(MODEL.laser.error)(
    scale=1.0, datum_offset=0.0, sigma=[0.0] * 3, resolution=0.0, range_min=0.0, range_max=1e6
)
EXACT = replace(MODEL, laser=replace(MODEL.laser, error=LAW))
DELAYS = MODEL.laser.time_increment * np.arange(MODEL.laser.beams)


def among(folder: Path, things: str, model: Model = MODEL, sensors: Sequence = ()) -> ChairSimulator:
    """The chair at the origin, looking east, among things."""
    path = folder / "t.world"
    path.write_text(f'position ( name "chair" pose [0 0 0 0] )\n{things}\n')
    simulator = ChairSimulator(model, load_world(path), DYNAMICS, sensors)
    simulator.reset(1)
    return simulator


def moving(v: float, w: float) -> Command:
    volts = float(MODEL.translation.volts(v)), float(MODEL.steering.volts(w))
    return Command(*volts, float(np.sign(v)), float(np.sign(w)))


def drive(simulator: ChairSimulator, v: float, w: float, seconds: float) -> list[Observation]:
    return [simulator.step(moving(v, w)) for _ in range(round(seconds / simulator.step_time))]


def where(simulator: ChairSimulator, name: str) -> np.ndarray:
    (index,) = (m.index for m in simulator.models if m.name == name)
    return simulator.model_poses[index]


def test_a_light_box_is_pushed_without_loss_of_speed(tmp_path):
    simulator = among(tmp_path, 'model ( name "box" pose [1.3 0 0 0] size [0.4 0.4 0.6] mass 5 )')
    last = drive(simulator, 0.5, 0.0, 4.0)[-1]
    np.testing.assert_allclose(last.pose, [2.0, 0.0, 0.0], atol=0.01)
    assert where(simulator, "box")[0] == pytest.approx(last.pose[0] + FRONT + 0.2, abs=0.005)


def test_a_box_at_the_limit_of_the_wheels_slows_the_chair(tmp_path):
    """The floor holds it with more than the wheels' grip: both slide, or stand."""
    heavy = WHEELS * MASS / FLOOR * 1.1
    simulator = among(tmp_path, f'model ( name "box" pose [1.3 0 0 0] size [0.4 0.4 0.6] mass {heavy} )')
    observations = drive(simulator, 0.5, 0.0, 4.0)
    assert observations[-1].contact
    assert abs(observations[-1].rates[0]) < 0.01
    pushed = where(simulator, "box")[0] - 1.3
    # The chair's energy is all there is to do work against what the floor holds more than the wheels give.
    assert 0 <= pushed < 0.5 * MASS * 0.5**2 / ((FLOOR * heavy - WHEELS * MASS) * GRAVITY) + 0.01


def test_a_box_that_takes_a_second_to_get_going_slows_the_chair_meanwhile(tmp_path):
    """Momentum: the wheels' surplus over the box's friction accelerates both."""
    box = 150.0
    simulator = among(tmp_path, f'model ( name "box" pose [0.91 0 0 0] size [0.4 0.4 0.6] mass {box} )')
    observations = drive(simulator, 1.0, 0.0, 8.0)
    speeds = np.array([o.rates[0] for o in observations])
    first = next(i for i, o in enumerate(observations) if o.contact)
    together = MASS * 1.0 / (MASS + box)
    surplus = (WHEELS * MASS - FLOOR * box) * GRAVITY / (MASS + box)
    times = DYNAMICS.contacts.step * np.arange(1, 31)
    assert speeds[first + 1] < 0.7
    np.testing.assert_allclose(speeds[first + 1 : first + 31], together + surplus * times, atol=0.03)
    assert speeds[-1] == pytest.approx(1.0)
    assert not observations[-1].contact


def test_a_door_is_opened(tmp_path):
    door = 'model ( name "door" pose [1.2 0 0 0] size [0.05 0.9 2] mass 15 hinge [0 0.45 -100 100] )'
    simulator = among(tmp_path, door)
    last = drive(simulator, 0.4, 0.0, 6.0)[-1]
    assert last.pose[0] > 2.0
    opened = where(simulator, "door")
    assert abs(opened[3]) > 1.0
    hinge = opened[:2] + 0.45 * np.array([-math.sin(opened[3]), math.cos(opened[3])])
    np.testing.assert_allclose(hinge, [1.2, 0.45], atol=1e-6)


def test_another_robot_that_stands_stops_the_chair(tmp_path):
    other = 'position ( name "other" pose [2 0 0 0] size [0.6 0.6 1] mass 400 )'
    simulator = among(tmp_path, other)
    last = drive(simulator, 0.6, 0.0, 5.0)[-1]
    assert last.contact
    assert abs(last.rates[0]) < 0.02
    assert where(simulator, "other")[0] == pytest.approx(2.0, abs=0.02)
    assert last.pose[0] + FRONT == pytest.approx(where(simulator, "other")[0] - 0.3, abs=0.005)


def test_another_robot_drives_as_its_file_says_until_it_is_told_otherwise(tmp_path):
    other = 'position ( name "other" pose [3 2 0 90] velocity [0.3 0 0 0] velocity_bounds [-0.5 0.5 0 0 0 0 -90 90] )'
    simulator = among(tmp_path, other)
    for _ in range(100):
        simulator.step(NEUTRAL)
    np.testing.assert_allclose(where(simulator, "other")[:2], [3.0, 2.3], atol=1e-9)
    simulator.command("other", [-9.0, 0.0, 0.0])
    for _ in range(100):
        simulator.step(NEUTRAL)
    np.testing.assert_allclose(where(simulator, "other")[:2], [3.0, 1.8], atol=1e-9)
    with pytest.raises(Error, match="chair"):
        simulator.command("chair", [0.1, 0.0, 0.0])
    with pytest.raises(Error, match="not finite"):
        simulator.command("other", [math.nan, 0.0, 0.0])


def test_one_that_runs_into_the_standing_chair_is_felt(tmp_path):
    simulator = among(tmp_path, 'position ( name "ram" pose [2 0 0 180] mass 60 velocity [0.5 0 0 0] )')
    observations = [simulator.step(NEUTRAL) for _ in range(300)]
    assert any(o.contact for o in observations)
    assert max(abs(o.pose[0]) for o in observations) < 0.05  # its wheels hold


def test_a_scan_sees_each_thing_where_it_is_when_the_beam_is_fired(tmp_path):
    """A wall that drives away at 1 m/s: the range of each beam in closed form."""
    wall = 'position ( name "wall" pose [3 0 0 0] size [0.2 30 1] mass 9999 velocity [1 0 0 0] )'
    simulator = among(tmp_path, wall, EXACT)
    bearings = MODEL.laser.bearings
    ahead = np.abs(bearings) < 1.0
    scans = [o.scan for o in (simulator.step(NEUTRAL) for _ in range(100)) if o.scan is not None]
    assert len(scans) >= 9
    for scan in scans:
        truth = (3 - 0.1 + (scan.time + DELAYS) - MODEL.laser.mount.x) / np.cos(bearings)
        np.testing.assert_allclose(scan.ranges[ahead], truth[ahead], atol=0.00126 / np.cos(1.0))


def test_a_passer_by_crosses_the_scan(tmp_path):
    walker = 'model ( pose [2 -2 0 0] size [0.3 0.3 1.7] mass 70 waypoint[0] [2 3] walk_speed 1 walk_mode "once" )'
    simulator = among(tmp_path, walker, EXACT)
    seen = []
    for _ in range(400):
        scan = simulator.step(NEUTRAL).scan
        if scan is not None and np.isfinite(scan.ranges).any():
            seen.append(float(MODEL.laser.bearings[np.isfinite(scan.ranges)].mean()))
    assert len(seen) > 35
    assert (np.diff(seen) > 0).all()
    assert seen[0] < -0.7
    assert seen[-1] > 0.7


def test_the_laser_looks_at_its_own_height(tmp_path):
    low = "model ( pose [2 0 0 0] size [0.2 9 0.39] )"
    lintel = "model ( pose [3 0 1 0] size [0.2 9 0.2] )"
    wall = "model ( pose [4 0 0 0] size [0.2 9 1] )"
    simulator = among(tmp_path, low + lintel + wall, EXACT)
    (scan,) = (o.scan for o in (simulator.step(NEUTRAL) for _ in range(10)) if o.scan is not None)
    middle = np.argmin(np.abs(MODEL.laser.bearings))
    assert scan.ranges[middle] == pytest.approx(3.9 - MODEL.laser.mount.x)
    assert drive(simulator, 0.5, 0.0, 4.0)[-1].pose[0] == pytest.approx(1.9 - FRONT, abs=0.005)  # and yet it is there


def test_what_is_over_the_chair_does_not_stop_it(tmp_path):
    simulator = among(tmp_path, "model ( pose [2 0 1.25 0] size [0.2 9 0.2] )")
    assert drive(simulator, 0.5, 0.0, 4.0)[-1].pose[0] == pytest.approx(2.0)


def test_a_wall_is_felt_where_it_is_seen_though_the_map_is_wrong(tmp_path):
    wrong = replace(EXACT, effects=(EffectSetting("world.map_error", {"scale": 0.1, "sd": 0.02}),))
    simulator = among(tmp_path, "model ( pose [2.5 0 0 0] size [1 3 1] )\nmodel ( pose [9 9 0 0] mass 1 )", wrong)
    scan = next(o.scan for o in (simulator.step(NEUTRAL) for _ in range(10)) if o.scan is not None)
    near = np.abs(MODEL.laser.bearings) < 0.3
    points = scan.ranges[near] * np.stack([np.cos(MODEL.laser.bearings[near]), np.sin(MODEL.laser.bearings[near])])
    slope, seen = np.polyfit(points[1], points[0] + MODEL.laser.mount.x, 1)
    assert abs(seen - 2.2) < 0.06
    assert abs(seen - 2.2) > 1e-4
    last = drive(simulator, 0.3, 0.0, 8.0)[-1].pose
    half = WIDTH / 2
    corners = last[:2] + [
        (FRONT * math.cos(last[2]) - y * math.sin(last[2]), FRONT * math.sin(last[2]) + y * math.cos(last[2]))
        for y in (half, -half)
    ]
    assert max(x - (seen + slope * y) for x, y in corners) == pytest.approx(0.0, abs=0.003)


def test_of_the_table_in_the_flat_the_laser_sees_the_legs(tmp_path):
    world = load_world(shipped("worlds/flat.world"))
    table = next(m for m in world.models if m.name == "table")
    x, y, _, _ = world.poses[table.index]
    simulator = ChairSimulator(EXACT, world, DYNAMICS)
    simulator.reset(1)
    simulator.set_pose("chair", (x - 1.6, y - 0.4, 0.0, 0.0))
    (scan,) = (o.scan for o in (simulator.step(NEUTRAL) for _ in range(10)) if o.scan is not None)
    bearings = MODEL.laser.bearings
    hits = np.column_stack(
        [
            x - 1.6 + MODEL.laser.mount.x + scan.ranges * np.cos(bearings),
            y - 0.4 + scan.ranges * np.sin(bearings),
        ]
    )
    near = (np.abs(hits - [x, y]) < [0.7 + 1e-9, 0.45 + 1e-9]).all(axis=1)
    assert near.sum() > 10  # legs, nothing between them
    assert (np.abs(np.abs(hits[near] - [x, y]) - [0.67, 0.42]) < 0.03 + 1e-9).all()


def test_the_shape_of_the_world_file_does_not_count(tmp_path):
    path = tmp_path / "t.world"
    path.write_text(
        "position ( pose [0 0 0 0] size [9 9 9] mass 1 model ( pose [3 0 0 0] ) ranger ( pose [2 0 0 0] ) )\n"
        "model ( pose [2 0 0 0] size [0.2 9 1] )"
    )
    simulator = ChairSimulator(EXACT, load_world(path), DYNAMICS)
    observations = [simulator.reset(1), *drive(simulator, 0.5, 0.0, 3.0)]
    assert observations[-1].pose[0] == pytest.approx(1.9 - FRONT, abs=0.005)
    first = next(o.scan for o in observations if o.scan is not None)
    assert np.nanmin(first.ranges) == pytest.approx(1.9 - MODEL.laser.mount.x - 0.5 * 0.07, abs=0.04)


@pytest.mark.parametrize("thing", ["model ( pose [0.2 0.1 0 0] size [0.05 0.05 1] )", "model ( pose [0.7 0 0 0] )"])
def test_a_start_on_something_is_refused(tmp_path, thing):
    with pytest.raises(Error, match="overlaps a wall at its start pose"):
        among(tmp_path, thing)


def test_set_pose_moves_things_and_the_chair_where_it_fits(tmp_path):
    things = 'model ( name "wall" pose [3 0 0 0] size [0.2 9 1] )\nmodel ( name "box" pose [2 2 0 0] mass 3 )'
    simulator = among(tmp_path, things, EXACT)
    drive(simulator, 0.3, 0.0, 0.5)
    with pytest.raises(Error, match=r"chair: does not fit at x 2.500 m, y 0.000 m, 0.0 deg; in the way: wall$"):
        simulator.set_pose("chair", (2.5, 0, 0, 0))
    with pytest.raises(Error, match="there is none"):
        simulator.set_pose("nobody", (2.5, 0, 0, 0))
    np.testing.assert_allclose(simulator.step(NEUTRAL).pose, [0.15, 0, 0], atol=1e-9)
    simulator.set_pose("chair", (1, -1, 0, 0))
    np.testing.assert_allclose(simulator.step(moving(0.5, 0.0)).pose, [1.005, -1, 0], atol=1e-9)
    simulator.set_pose("wall", (5, 0, 0, 0))  # a wall, too, with all that stands
    simulator.set_pose("box", (4, -1, 0, 0))
    assert where(simulator, "box")[0] == 4
    scan = [o.scan for o in (simulator.step(NEUTRAL) for _ in range(30)) if o.scan is not None][-1]
    middle = np.argmin(np.abs(MODEL.laser.bearings))
    assert scan.ranges[middle] == pytest.approx(4 - 0.2 - 1.005 - MODEL.laser.mount.x, abs=1e-6)
    simulator.set_pose("box", (4, 4, 0, 0))
    assert drive(simulator, 0.5, 0.0, 8.0)[-1].pose[0] == pytest.approx(4.9 - FRONT, abs=0.005)
    assert simulator.reset(1).pose.tolist() == [0, 0, 0]
    assert where(simulator, "wall").tolist() == [3, 0, 0, 0]
    assert where(simulator, "box").tolist() == [2, 2, 0, 0]


THINGS = """
model ( name "box" pose [1.2 0.1 0 0] size [0.4 0.4 0.6] mass 8 )
position ( name "other" pose [3 1 0 200] velocity [0.3 0 0 20] )
model ( pose [2 -2 0 0] size [0.3 0.3 1.7] mass 70 waypoint[0] [2 3] waypoint[1] [2 -2] walk_speed 1 social 1 )
model ( pose [5 0 0 0] size [0.2 9 1] ranger_return 0.5 )
"""


def everything() -> Model:
    """The chair with every effect, a little of each."""
    some = [
        EffectSetting(effect.id, {p.name: p.null + 0.2 * p.scale for p in effect.parameters}) for effect in effects.ALL
    ]
    return replace(MODEL, effects=tuple(some))


def bytes_of(observations: list[Observation]) -> bytes:
    parts = []
    for o in observations:
        parts += [o.pose.tobytes(), o.rates.tobytes(), bytes([o.contact]), o.reference.poses.tobytes()]
        parts += [o.scan.ranges.tobytes()] if o.scan else []
    return b"".join(parts)


def test_a_seed_is_a_run_bit_for_bit_among_things_that_move(tmp_path):
    simulator = among(tmp_path, THINGS, everything())
    runs = []
    for seed in (4, 4, 5):
        start = simulator.reset(seed)
        runs.append(bytes_of([start, *drive(simulator, 0.6, 0.1, 2.0)]))
    assert runs[0] == runs[1] != runs[2]
    again = among(tmp_path, THINGS, everything())
    assert bytes_of([again.reset(4), *drive(again, 0.6, 0.1, 2.0)]) == runs[0]


@pytest.mark.parametrize("things", [THINGS, "model ( pose [5 0 0 0] size [0.2 9 1] )"])
def test_a_saved_state_goes_on_bit_for_bit(tmp_path, things):
    sensors = [s for s in load_sensors(shipped("launch/sensors.yaml")) if s.name != "camera"]
    simulator = among(tmp_path, things, everything(), sensors)
    simulator.reset(7)
    drive(simulator, 0.6, 0.1, 1.234)
    saved, mark = simulator.save(), simulator.state_hash()
    went_on = drive(simulator, 0.5, -0.2, 1.0)
    other = among(tmp_path, things, everything(), sensors)
    loaded = other.load(saved)
    assert other.state_hash() == mark
    assert loaded.time == pytest.approx(1.23)
    assert bytes_of(drive(other, 0.5, -0.2, 1.0)) == bytes_of(went_on)
    assert other.state_hash() == simulator.state_hash()
    with pytest.raises(Error, match="belongs to another world"):
        among(tmp_path, things).load(saved)
    with pytest.raises(Error, match="state: "):
        simulator.load(saved[:-50])


def test_sensors_read_what_the_chair_does(tmp_path):
    sensors = load_sensors(shipped("launch/sensors.yaml"))
    simulator = among(tmp_path, "model ( pose [1.2 0 0 0] size [0.2 9 1] )", MODEL, sensors)
    readings = {}
    for observation in drive(simulator, 0.5, 0.0, 2.0):
        readings.update({reading.sensor.name: reading.value for reading in observation.readings})
    assert set(readings) == {"imu", "battery", "sonar", "bumper", "camera", "fiducial"}
    assert readings["bumper"].tolist() == [[True, False]]


def test_a_sensor_of_nobody_is_refused(tmp_path):
    sensors = [replace(load_sensors(shipped("launch/sensors.yaml"))[0], robot="nobody")]
    with pytest.raises(Error, match="nobody"):
        among(tmp_path, "", MODEL, sensors)
