# SPDX-License-Identifier: BSD-3-Clause
"""Effects on the laser in the simulator, switched on in a file: a flat wall's ranges in closed form."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.params import Model, load_model, shipped
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.world import load_world

MODEL = load_model(shipped("launch/md100.yaml"))
DYNAMICS = load_dynamics(shipped("launch/physical.yaml"))
LASER = MODEL.laser
BEARINGS = LASER.bearings
DELAYS = LASER.time_increment * np.arange(LASER.beams)
NULLS = {effect.id: {p.name: p.null for p in effect.parameters} for effect in effects.ALL}


def exact() -> Model:
    """The chair with a laser that reads the true range."""
    law = type(LASER.error)(scale=1.0, datum_offset=0.0, sigma=[0.0] * 3, resolution=0.0, range_min=0.0, range_max=1e6)
    return replace(MODEL, laser=replace(LASER, error=law))


def simulator(folder: Path, model: Model, listed: dict, wall: str = "") -> ChairSimulator:
    """A wall at x = 8; the chair starts at the origin and heads for it."""
    world, file = folder / "wall.world", folder / "effects.yaml"
    world.write_text(f"model ( pose [9 0 0 0] size [2 999 1] {wall} )\nposition ( pose [0 0 0 0] )")
    items = [{"id": name, "parameters": {**NULLS[name], **values}} for name, values in listed.items()]
    file.write_text(yaml.safe_dump({"effects": items}))
    it = ChairSimulator(with_effects(model, file), load_world(world), DYNAMICS)
    it.reset(5)
    return it


def scans(it: ChairSimulator, command: Command, seconds: float):
    observations = [it.step(command) for _ in range(round(seconds / it.step_time))]
    return [o.scan for o in observations if o.scan is not None]


def moving(v: float, w: float) -> Command:
    volts = float(MODEL.translation.volts(v)), float(MODEL.steering.volts(w))
    return Command(*volts, float(np.sign(v)), float(np.sign(w)))


def expected(t, w, mount=(0.3, 0.0, 0.0), bearings=BEARINGS):
    """Ranges to the wall of a chair that turns on the spot, beam i being fired at t[i] from rest at 0."""
    heading = w * np.maximum(t, 0.0)
    x = mount[0] * np.cos(heading) - mount[1] * np.sin(heading)
    along = np.cos(heading + mount[2] + bearings)
    return np.where(along > 0.01, (8 - x) / np.maximum(along, 0.01), np.inf)


def compare(ranges, truth, rtol=1e-4):
    near = truth < 50
    assert near.sum() > 200
    np.testing.assert_allclose(ranges[near], truth[near], rtol=rtol)


STEEPNESS = 1 / np.maximum(np.cos(BEARINGS), np.cos(np.deg2rad(80)))
STILL = [
    ({"laser.mount_x": {"x": 0.1}}, expected(0 * DELAYS, 0, (0.4, 0, 0))),
    ({"laser.mount_y": {"y": 0.1}}, expected(0 * DELAYS, 0, (0.3, 0.1, 0))),
    ({"laser.mount_yaw": {"yaw": 0.05}}, expected(0 * DELAYS, 0, (0.3, 0, 0.05))),
    ({"laser.scale": {"scale": 0.01}, "laser.offset": {"offset": 0.1}}, 1.01 * expected(0 * DELAYS, 0) + 0.1),
    ({"world.map_error": {"scale": 0.01}}, expected(0 * DELAYS, 0) * 7.78 / 7.7),
    ({"laser.incidence_bias": {"k": 0.1}}, expected(0 * DELAYS, 0) + 0.1 * (STEEPNESS - 1)),
    # the wall is 7.7 m ahead; looking down by 0.04 rad the floor is met after 0.4 m / sin(0.04) = 10 m at the front
    (
        {"laser.tilt": {"pitch": 0.04}},
        np.minimum(expected(0 * DELAYS, 0) / np.cos(0.04), 0.4 / np.sin(0.04) / np.maximum(np.cos(BEARINGS), 1e-9)),
    ),
]


@pytest.mark.parametrize(("listed", "truth"), STILL, ids=lambda it: next(iter(it)) if isinstance(it, dict) else "")
def test_standing_before_a_wall(tmp_path, listed, truth):
    (scan,) = scans(simulator(tmp_path, exact(), listed), NEUTRAL, 0.1)
    compare(scan.ranges, truth, 1e-9)


TURNING = [
    ({"laser.latency": {"delay": 0.05}}, lambda t0: t0 + DELAYS - 0.05),
    ({"laser.latency": {"delay": -0.05}}, lambda t0: t0 + DELAYS + 0.05),
    ({"laser.clock_skew": {"skew": 0.02}}, lambda t0: (t0 + DELAYS) / 1.02),
    ({"laser.clock_skew": {"skew": -0.02}}, lambda t0: (t0 + DELAYS) / 0.98),
    ({"laser.sweep": {"stretch": -1.0}}, lambda t0: t0 + 0 * DELAYS),
    ({"laser.sweep": {"stretch": 1.0}, "laser.latency": {"delay": 0.02}}, lambda t0: t0 + 2 * DELAYS - 0.02),
]


@pytest.mark.parametrize(("listed", "fired"), TURNING, ids=lambda it: next(iter(it)) if isinstance(it, dict) else "")
def test_turning_before_a_wall(tmp_path, listed, fired):
    seen = scans(simulator(tmp_path, exact(), listed), moving(0.0, 0.5), 2.0)
    assert len(seen) >= 19
    for scan in seen:
        compare(scan.ranges, expected(fired(scan.time), 0.5))
        assert scan.pose[2] == pytest.approx(0.5 * scan.time, abs=1e-9)  # where the chair is at the stamp


def test_a_dark_wall_is_read_by_its_return(tmp_path):
    dark = simulator(tmp_path, exact(), {"laser.reflectance": {"bias": 0.02}}, "ranger_return 0.25")
    (scan,) = scans(dark, NEUTRAL, 0.1)
    compare(scan.ranges, expected(0 * DELAYS, 0) + 0.015, 1e-9)


def run(folder: Path, listed: dict) -> list[np.ndarray]:
    """Times, poses and scans of a drive among a bright wall, a dark one and a post, with the laser's own noise."""
    world, file = folder / "walls.world", folder / "effects.yaml"
    world.write_text(
        "model ( pose [0 2 0 0] size [9 0.1 1] )\nmodel ( pose [0 -2 0 0] size [9 0.1 1] ranger_return 0.5 )\n"
        "model ( pose [1.2 1.2 0 0] size [0.1 0.1 1] )\nposition ( pose [0 0 0 0] )"
    )
    items = [{"id": name, "parameters": dict(values)} for name, values in listed.items()]
    file.write_text(yaml.safe_dump({"effects": items}))
    it = ChairSimulator(with_effects(MODEL, file), load_world(world), DYNAMICS)
    observations = [it.reset(9)]
    for v, w in [(0.7, 0.3), (-0.3, -0.2)]:
        observations += [it.step(moving(v, w)) for _ in range(75)]
    assert sum(o.scan is not None for o in observations) >= 14
    return [
        a
        for o in observations
        for a in (o.pose, o.reference.times, o.reference.poses, *([o.scan.ranges] if o.scan else []))
    ]


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> list[np.ndarray]:
    return run(tmp_path_factory.mktemp("plain"), {})


@pytest.mark.parametrize("effect", effects.ALL, ids=lambda effect: effect.id)
def test_every_effect_can_be_switched_on_in_a_file(tmp_path, plain, effect):
    usual = effect.forms[0] if effect.forms else {}
    typical = {p.name: p.null + p.scale for p in effect.parameters} | dict(usual)
    on, off = run(tmp_path, {effect.id: typical}), run(tmp_path, {effect.id: NULLS[effect.id]})
    assert any(a.shape != b.shape or not np.array_equal(a, b, equal_nan=True) for a, b in zip(on, plain, strict=False))
    for a, b in zip(off, plain, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_all_effects_at_once(tmp_path):
    everything = {effect.id: {p.name: p.null + 0.3 * p.scale for p in effect.parameters} for effect in effects.ALL}
    first, again = run(tmp_path, everything), run(tmp_path, everything)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, again, strict=True))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{id: laser.nonsense, parameters: {}}", r"'laser\.nonsense' is not in the catalogue"),
        ("{id: laser.offset, parameters: {offset: 9.0}}", r"laser\.offset: offset must be -0\.5 to 0\.5 m: 9"),
        (
            "{id: world.map_error, parameters: {scale: 0.0}}",
            r"world\.map_error: needs the parameters scale, sd; got scale",
        ),
        ("{id: laser.scale, parameters: {scale: 0.0}}, {id: laser.scale, parameters: {scale: 0.1}}", "given twice"),
    ],
)
def test_bad_effects_are_refused(tmp_path, text, message):
    file = tmp_path / "effects.yaml"
    file.write_text(f"effects: [{text}]")
    with pytest.raises(Error, match=message):
        ChairSimulator(with_effects(MODEL, file), load_world(shipped("worlds/room.world")), DYNAMICS)
