# SPDX-License-Identifier: BSD-3-Clause
"""The simulator without ROS: motion, contacts, laser and repeatability against analytic truth."""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from kurumaisu.errors import Error
from kurumaisu.geometry import compose, wrap
from kurumaisu.params import EffectSetting, Model, load_model, shipped
from kurumaisu.sim.chair.holder import VoltageHolder
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command, Observation
from kurumaisu.sim.settings import Dynamics, load_dynamics, with_effects
from kurumaisu.types import FloatArray
from kurumaisu.urdf import robot_description
from kurumaisu.world import World, load_world

WORLDS = sorted(shipped("worlds/room.world").parent.glob("*.world"))
# The round that worlds/building.world describes.
ROUND = [(10.95, 1.0), (10.95, 5.1), (6.2, 5.1), (6.2, 7.5), (3.0, 7.5), (3.0, 5.1), (1.0, 5.1), (1.0, 1.0)]


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(shipped("launch/md100.yaml"))


@pytest.fixture(scope="module")
def dynamics() -> Dynamics:
    return load_dynamics(shipped("launch/physical.yaml"))


def rates_command(model: Model, v: float, w: float) -> Command:
    volts = float(model.translation.volts(v)), float(model.steering.volts(w))
    return Command(*volts, float(np.sign(v)), float(np.sign(w)))


def walled(folder: Path, walls: str, start: str = "0 0 0 0") -> World:
    path = folder / "t.world"
    path.write_text(f"{walls}\nposition ( pose [{start}] )")
    return load_world(path)


def free(folder: Path) -> World:
    return walled(folder, "model ( pose [500 0 0 0] )")


def drive(simulator: ChairSimulator, command: Command, seconds: float) -> Iterator[Observation]:
    for _ in range(round(seconds / simulator.step_time)):
        yield simulator.step(command)


@pytest.mark.parametrize(("v", "w"), [(0.5, 0.3), (-0.4, 0.7), (0.8, 0.0), (0.0, -0.9), (0.6, -0.05)])
def test_free_motion_is_the_arc_of_equation_3(
    model: Model, dynamics: Dynamics, tmp_path: Path, v: float, w: float
) -> None:
    simulator = ChairSimulator(model, free(tmp_path), dynamics)
    simulator.reset(1)
    last = list(drive(simulator, rates_command(model, v, w), 10.0))[-1]
    arc = (v / w * math.sin(10 * w), v / w * (1 - math.cos(10 * w))) if w else (10 * v, 0.0)
    np.testing.assert_allclose(last.pose, [*arc, 10 * w], atol=1e-10)
    np.testing.assert_allclose(last.rates, [v, 0, w], atol=1e-12)
    assert last.time == pytest.approx(10.0, abs=1e-12)
    assert not last.contact


def test_effects_of_the_model_and_of_a_file_act(model: Model, dynamics: Dynamics, tmp_path: Path) -> None:
    path = tmp_path / "effects.yaml"
    path.write_text("effects: [{id: base.veer, parameters: {curvature: 0.1, apart: 0.0}}]")
    slow = replace(model, effects=(EffectSetting("base.gain_v", {"gain": -0.5}),))
    simulator = ChairSimulator(with_effects(slow, path), free(tmp_path), dynamics)
    simulator.reset(1)
    last = list(drive(simulator, rates_command(model, 0.6, 0.0), 1.0))[-1]
    assert last.rates[0] == pytest.approx(0.3)
    assert last.rates[2] == pytest.approx(0.03)  # veer after the gain, as in the catalogue


def test_bad_effects_are_refused(model: Model, dynamics: Dynamics, tmp_path: Path) -> None:
    path = tmp_path / "effects.yaml"
    path.write_text("effects: [{id: base.veer, parameters: {curvature: x, apart: 0.0}}]")
    with pytest.raises(Error, match=r"effects\.yaml: effects\[0\]\.parameters\.curvature: must be a number"):
        with_effects(model, path)
    path.write_text("effects: [{id: base.veer, parameters: {curvature: 0.1, apart: 0.0}, extra: 1}]")
    with pytest.raises(Error, match=r"effects\[0\]\.extra: is not a known key"):
        with_effects(model, path)
    unknown = replace(model, effects=(EffectSetting("base.nonsense", {}),))
    with pytest.raises(Error, match=r"'base\.nonsense' is not in the catalogue"):
        ChairSimulator(unknown, free(tmp_path), dynamics).reset(1)


def run_hash(model: Model, dynamics: Dynamics, seed: int) -> str:
    noisy = with_effects(model, shipped("launch/uneven_floor.yaml"))
    simulator = ChairSimulator(noisy, load_world(shipped("worlds/room.world")), dynamics)
    digest = hashlib.sha256()
    observations = [simulator.reset(seed)]
    for v, w in [(0.5, 0.2), (0.3, -0.5), (1.0, 0.0), (-0.3, 0.4)]:  # the third drives against a wall
        observations += drive(simulator, rates_command(model, v, w), 5.0)
    assert any(o.contact for o in observations)
    assert sum(o.scan is not None for o in observations) == 200
    for o in observations:
        digest.update(o.pose.tobytes() + o.rates.tobytes() + bytes([o.contact]))
        if o.scan is not None:
            digest.update(o.scan.ranges.tobytes() + o.scan.pose.tobytes())
    return digest.hexdigest()


def test_a_seed_is_a_run_bit_for_bit(model: Model, dynamics: Dynamics) -> None:
    assert run_hash(model, dynamics, 7) == run_hash(model, dynamics, 7)
    assert run_hash(model, dynamics, 7) != run_hash(model, dynamics, 8)


def test_reset_forgets_everything(model: Model, dynamics: Dynamics) -> None:
    simulator = ChairSimulator(model, load_world(shipped("worlds/room.world")), dynamics)
    command = rates_command(model, 0.9, 0.3)
    simulator.reset(3)
    first = [o.pose.tolist() for o in drive(simulator, command, 8.0)]
    start = simulator.reset(3)
    assert start.time == 0
    np.testing.assert_array_equal(start.pose, [1.5, 2.0, 0.0])
    assert [o.pose.tolist() for o in drive(simulator, command, 8.0)] == first


def depth_in_wall(model: Model, pose: FloatArray, wall_x: float) -> float:
    """How far the foremost corner of the footprint is beyond x = wall_x [m]."""
    front, half = model.chassis.axle_to_front, model.chassis.width / 2
    rear = front - model.chassis.length
    corners = np.array([[x, y, 0] for x in (front, rear) for y in (half, -half)])
    return float(compose(np.broadcast_to(pose, corners.shape), corners)[:, 0].max() - wall_x)


@pytest.mark.parametrize("degrees", [0, 3, 20, 45, 70, 180, 200])
@pytest.mark.parametrize("speed", [0.3, 1.5])
@pytest.mark.parametrize("thickness", [0.001, 0.1])
def test_a_wall_stops_the_chair(
    model: Model, dynamics: Dynamics, tmp_path: Path, degrees: float, speed: float, thickness: float
) -> None:
    wall = f"model ( pose [{1.2 + thickness / 2} 0 0 0] size [{thickness} 200 1] )"
    simulator = ChairSimulator(model, walled(tmp_path, wall, f"0 0 0 {degrees}"), dynamics)
    simulator.reset(1)
    v = speed if degrees < 90 else -speed
    observations = list(drive(simulator, rates_command(model, v, 0.0), 12.0))
    assert any(o.contact for o in observations)
    assert max(depth_in_wall(model, o.pose, 1.2) for o in observations) < 0.005


@pytest.mark.parametrize("w", [0.5, -0.5])
def test_turning_into_a_wall(model: Model, dynamics: Dynamics, tmp_path: Path, w: float) -> None:
    wall = "model ( pose [0.9 0 0 0] size [0.2 200 1] )"
    simulator = ChairSimulator(model, walled(tmp_path, wall, "0.35 0 0 90"), dynamics)
    simulator.reset(1)
    observations = list(drive(simulator, rates_command(model, 0.0, w), 10.0))
    assert max(depth_in_wall(model, o.pose, 0.8) for o in observations) < 0.005


def test_a_grazed_wall_is_slid_along(model: Model, dynamics: Dynamics, tmp_path: Path) -> None:
    wall = "model ( pose [0 0.75 0 0] size [200 0.5 1] )"
    simulator = ChairSimulator(model, walled(tmp_path, wall, "0 0 0 10"), dynamics)
    simulator.reset(1)
    last = list(drive(simulator, rates_command(model, 0.5, 0.0), 20.0))[-1]
    assert last.pose[0] > 7.0  # of 10 m
    assert abs(wrap(last.pose[2])) < 0.05  # the wall turned it


def test_a_chair_leaves_a_wall(model: Model, dynamics: Dynamics, tmp_path: Path) -> None:
    simulator = ChairSimulator(model, walled(tmp_path, "model ( pose [1.5 0 0 0] size [1 9 1] )"), dynamics)
    simulator.reset(1)
    blocked = list(drive(simulator, rates_command(model, 0.5, 0.0), 2.0))[-1]
    assert blocked.contact
    assert abs(blocked.rates[0]) < 0.05
    back = list(drive(simulator, rates_command(model, -0.5, 0.0), 2.0))
    assert not back[-1].contact
    assert back[-1].pose[0] == pytest.approx(blocked.pose[0] - 1.0, abs=0.02)


def scans(simulator: ChairSimulator, command: Command, count: int) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    found = 0
    while found < count:
        scan = simulator.step(command).scan
        if scan is not None:
            found += 1
            yield scan.ranges, scan.pose, scan.time


def test_noise_follows_what_the_chair_does(model: Model, dynamics: Dynamics, tmp_path: Path) -> None:
    """Four times as much from 0.3 m/s backwards on."""
    wall = "model ( pose [2.35 0 0 0] size [0.1 20 1] )"
    values = {"knot_0": -0.3, "knot_1": 0.0, "value_0": math.log(4), "value_1": 0.0}
    shaken = replace(model, effects=(EffectSetting("smooth.scatter.v", values),))
    spread = []
    for one in (model, shaken):
        simulator = ChairSimulator(one, walled(tmp_path, wall), dynamics)
        simulator.reset(11)
        moving = [np.diff(ranges, 2)[330:350] for ranges, _, _ in scans(simulator, rates_command(model, -0.4, 0.0), 20)]
        spread.append(np.std(moving[5:]))
    assert spread[1] / spread[0] == pytest.approx(4, rel=0.2)


def test_a_flat_wall_reads_as_equation_4(model: Model, dynamics: Dynamics, tmp_path: Path) -> None:
    # 1 m before the laser, whose mount is 0.3 m before base_link; figure 7's wall.
    wall = "model ( pose [1.35 0 0 0] size [0.1 20 1] )"
    simulator = ChairSimulator(model, walled(tmp_path, wall), dynamics)
    simulator.reset(11)
    readings = np.array([r for r, _, _ in scans(simulator, NEUTRAL, 400)])
    bearings = model.laser.bearings
    beams = np.flatnonzero(np.abs(bearings) < 1.2)
    truth = 1 / np.cos(bearings[beams])
    readings = readings[:, beams]
    assert np.isfinite(readings).all()
    n = len(readings)
    mu = 1.004587 * truth + 0.058826
    resolution = 0.001
    sigma = np.sqrt((0.000199 * truth**2 - 0.000488 * truth + 0.002334) ** 2 + resolution**2 / 12)
    z = (readings.mean(axis=0) - mu) / (sigma / math.sqrt(n))
    assert np.abs(z).max() < 5
    assert (z**2).sum() == pytest.approx(len(beams), abs=5 * math.sqrt(2 * len(beams)))
    chi2 = (((readings - mu) / sigma) ** 2).sum()
    assert chi2 == pytest.approx(readings.size, abs=5 * math.sqrt(2 * readings.size))
    np.testing.assert_allclose(readings / resolution, np.round(readings / resolution), atol=1e-9)


def exact(model: Model) -> Model:
    """The same chair with a laser that reads the true range."""
    law = type(model.laser.error)(
        scale=1.0, datum_offset=0.0, sigma=[0.0] * 3, resolution=0.0, range_min=0.0, range_max=1e6
    )
    return replace(model, laser=replace(model.laser, error=law))


@pytest.mark.parametrize(("v", "w"), [(0.6, 0.0), (0.0, 0.9), (0.5, -0.7)])
def test_every_beam_leaves_from_where_the_laser_is_then(
    model: Model, dynamics: Dynamics, tmp_path: Path, v: float, w: float
) -> None:
    """The wall is flat, so the true pose at each beam's own time predicts its range in closed form."""
    simulator = ChairSimulator(exact(model), walled(tmp_path, "model ( pose [9 0 0 0] size [2 9999 1] )"), dynamics)
    simulator.reset(1)
    seen = 0
    for ranges, pose, t0 in scans(simulator, rates_command(model, v, w), 12):
        t = t0 + model.laser.time_increment * np.arange(model.laser.beams)
        x = v / w * np.sin(w * t) if w else v * t
        heading = w * t + model.laser.bearings
        laser_x = x + model.laser.mount.x * np.cos(w * t)
        ahead = np.cos(heading) > 0.05
        seen += int(ahead.sum())
        np.testing.assert_allclose(ranges[ahead], ((8 - laser_x) / np.cos(heading))[ahead], rtol=1e-4)
        assert pose[0] == pytest.approx(x[0], abs=1e-5)
        assert pose[2] == pytest.approx(w * t0, abs=1e-9)
    assert seen > 1000


def test_scans_come_every_scan_time(model: Model, dynamics: Dynamics) -> None:
    simulator = ChairSimulator(model, load_world(shipped("worlds/room.world")), dynamics)
    simulator.reset(1)
    times = [time for _, _, time in scans(simulator, NEUTRAL, 50)]
    np.testing.assert_allclose(times, 0.1 * np.arange(50), atol=1e-12)


def test_a_fan_longer_than_its_scan_is_refused(model: Model, dynamics: Dynamics) -> None:
    slow = replace(model, laser=replace(model.laser, time_increment=0.001))
    with pytest.raises(Error, match=r"0\.681 s after the first, more than scan_time = 0\.1 s"):
        ChairSimulator(slow, load_world(WORLDS[0]), dynamics).reset(1)


@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_shipped_worlds_hold_the_chair(model: Model, dynamics: Dynamics, path: Path) -> None:
    simulator = ChairSimulator(model, load_world(path), dynamics)
    simulator.reset(1)
    assert not any(o.contact for o in drive(simulator, rates_command(model, 0.3, 0.0), 1.0))


def test_a_start_in_a_wall_is_refused(model: Model, dynamics: Dynamics, tmp_path: Path) -> None:
    with pytest.raises(Error, match=r"t\.world: the chair, .* overlaps a wall at its start pose"):
        ChairSimulator(model, walled(tmp_path, "model ( pose [0.7 0 0 0] size [0.1 9 1] )"), dynamics)


def test_the_building_can_be_driven_round(model: Model, dynamics: Dynamics) -> None:
    """Corners are turned on the spot, legs driven at 0.55 m/s; walls stay within 4 m of the laser."""
    simulator = ChairSimulator(model, load_world(shipped("worlds/building.world")), dynamics)
    observation = simulator.reset(1)
    seen: list[int] = []
    for target in ROUND:
        while np.hypot(*(np.array(target) - observation.pose[:2])) > 0.05:
            x, y, heading = observation.pose
            error = float(wrap(math.atan2(target[1] - y, target[0] - x) - heading))
            v = 0.55 if abs(error) < 0.1 else 0.0
            observation = simulator.step(rates_command(model, v, float(np.clip(4 * error, -1.0, 1.0))))
            assert not observation.contact
            assert observation.time < 120
            if observation.scan is not None:
                seen.append(int(np.isfinite(observation.scan.ranges).sum()))
    assert 60 < observation.time < 90
    assert min(seen) > 200


def test_the_holder_goes_by_stamps_and_never_lets_go() -> None:
    holder = VoltageHolder()
    a, b = Command(1.0, 0.0, 1.0, 0.0), Command(2.0, 0.0, 1.0, 0.0)
    assert holder.at(0) == NEUTRAL
    holder.put(100, a)
    holder.put(200, b)
    assert [holder.at(t) for t in (99, 100, 199, 200, 10**15)] == [NEUTRAL, a, a, b, b]
    with pytest.raises(Error, match="stamp 150 ns is older"):
        holder.put(150, a)
    with pytest.raises(Error, match="not finite"):
        holder.put(300, replace(a, v_s=math.nan))
    assert holder.at(400) == b
    holder.clear()
    assert holder.at(500) == NEUTRAL


def test_commands_are_due_when_the_usual_gap_has_passed() -> None:
    holder = VoltageHolder()
    assert not holder.is_due(10**9, lead=50)  # nobody has spoken yet
    holder.put(100, NEUTRAL)
    assert [holder.is_due(t, lead=50) for t in (149, 150)] == [False, True]
    for stamp in (120, 140, 140, 170):
        holder.put(stamp, NEUTRAL)
    assert [holder.is_due(t, lead=50) for t in (199, 200)] == [False, True]
    assert [holder.is_due(t, lead=25) for t in (194, 195)] == [False, True]
    for stamp in range(190, 350, 20):
        holder.put(stamp, NEUTRAL)
    assert [holder.is_due(t, lead=50) for t in (349, 350)] == [False, True]
    holder.clear()
    assert not holder.is_due(10**9, lead=50)


def test_urdf_says_what_the_model_says(model: Model) -> None:
    robot = ElementTree.fromstring(robot_description(model, "base_link"))
    assert [link.get("name") for link in robot.findall("link")] == ["base_link", "laser"]
    joint = robot.find("joint")
    assert joint is not None
    assert joint.get("type") == "fixed"
    origin = joint.find("origin")
    assert origin is not None
    assert [float(x) for x in origin.get("xyz", "").split()] == [0.3, 0.0, 0.4]
    box = robot.find("link/visual/geometry/box")
    assert box is not None
    assert [float(x) for x in box.get("size", "").split()][:2] == [1.0, 0.6]
