# SPDX-License-Identifier: BSD-3-Clause
"""The sensors on the simulator's own ray caster, against every ray with every wall."""

import numpy as np
import pytest
from sensing import BruteRays, make_model, rectangle

from kurumaisu._core import Arena
from kurumaisu.geometry import attached
from kurumaisu.sim.sensors.bumper import BumperSensor, BumperSettings
from kurumaisu.sim.sensors.fiducial import FiducialFinder
from kurumaisu.sim.sensors.rays import Rays
from kurumaisu.sim.sensors.sonar import Sonar, SonarSettings
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Bumper, Fiducial, Model

ROBOTS = 40
BODY = rectangle(0.6, 0.4)


def outline(model: Model) -> FloatArray:
    return np.hstack([model.shape.segments, model.shape.heights])


@pytest.fixture(params=[1, 2, 3], name="scene")
def random_scene(request: pytest.FixtureRequest) -> tuple[Rays, Rays, FloatArray, list[Model]]:
    """Walls and marked robots: an Arena, the same by brute force, the robots' poses, and the robots."""
    rng = np.random.default_rng(request.param)
    a = rng.uniform(-6, 6, (60, 2))
    walls = np.hstack([a, a + rng.uniform(-1, 1, (60, 2)), np.tile([0.0, 0.5], (60, 1))])
    models = [make_model(i, BODY, (0.0, 0.45), fiducial=(i + 1, 0)) for i in range(ROBOTS)]
    poses = np.hstack([rng.uniform(-6, 6, (ROBOTS, 2)), np.zeros((ROBOTS, 1)), rng.uniform(-3, 3, (ROBOTS, 1))])
    arena = Arena(walls, np.ones(60), np.ones(60, dtype=bool), np.full(60, -1), 2)
    faces = outline(models[0])
    bodies = [arena.add_body(faces, np.ones(4), np.ones(4, dtype=bool), i) for i in range(ROBOTS)]
    arena.set_poses(np.array(bodies), poses)
    ends = [faces[:, [0, 1]], faces[:, [2, 3]]]
    placed = [attached(pose, np.hstack([end, np.zeros((4, 2))]))[:, :2].reshape(4, 2) for pose in poses for end in ends]
    moved = np.hstack([np.concatenate(placed[0::2]), np.concatenate(placed[1::2]), np.tile(faces[:, 4:], (ROBOTS, 1))])
    trees: IntArray = np.concatenate([np.full(60, -1), np.repeat(np.arange(ROBOTS), 4)])
    return arena, BruteRays(np.concatenate([walls, moved]), trees=trees), poses, models


def test_sonars(scene: tuple[Rays, Rays, FloatArray, list[Model]]) -> None:
    arena, brute, poses, _ = scene
    mounts = np.array([[0.3, 0, 0.2, 0.0], [-0.3, 0, 0.2, np.pi], [0.0, 0.2, 0.2, 1.5]])
    sonar = Sonar(SonarSettings(mounts, 0.5, 9, 0.05, 3.0, 0.01))
    one, other = (sonar.read(rays, poses, np.arange(ROBOTS), np.random.default_rng(4)) for rays in (arena, brute))
    assert np.isfinite(one).any()
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_bumpers(scene: tuple[Rays, Rays, FloatArray, list[Model]]) -> None:
    arena, brute, poses, _ = scene
    strips = Bumper(np.array([[0.3, 0, 0.1, 0], [-0.3, 0, 0.1, np.pi]]), np.array([0.4, 0.4]))
    for travel in (0.0, 0.1):
        sensor = BumperSensor(BumperSettings(strips, travel))
        one, other = (sensor.read(rays, poses, np.arange(ROBOTS)) for rays in (arena, brute))
        assert one.any()
        assert not one.all()
        np.testing.assert_array_equal(one, other)


def test_fiducials(scene: tuple[Rays, Rays, FloatArray, list[Model]]) -> None:
    arena, brute, poses, models = scene
    finder = FiducialFinder(Fiducial(0.0, 4.0, 3.0, 3.0, False, 0), models)
    eyes = poses + np.array([0, 0, 0.3, 0])
    one, other = (finder.find(rays, eyes, np.arange(ROBOTS), poses) for rays in (arena, brute))
    assert len(one.id) > ROBOTS
    assert (one.finder != one.model).all()
    np.testing.assert_array_equal(one.finder, other.finder)
    np.testing.assert_array_equal(one.model, other.model)
