# SPDX-License-Identifier: BSD-3-Clause
"""What there is to draw of a simulation: pieces, where the simulator has them."""

import numpy as np
import pytest

from kurumaisu import settings
from kurumaisu.params import shipped
from kurumaisu.sim.options import read_options
from kurumaisu.sim.robots.scenery import bounds, scenery
from kurumaisu.sim.robots.simulator import Simulator
from kurumaisu.world import load_world

WORLD = """
define laser ranger ( size [0.1 0.1 0.1] sensor ( range [0 5] fov 180 samples 7 ) )
position ( name "robot" pose [1 2 0 90] size [0.4 0.2 0.5] color "red" laser ( pose [0.1 0 0 0] )
  model ( size [0.1 0.1 0.1] ) )
model ( name "box" pose [3 0 0 0] size [1 0.5 1] )
model ( name "long" pose [0 -3 0 0] size [8 0.1 1] )
model ( name "part" pose [-1 -1 0 0] size [0.6 0.1 2.4] )
model ( pose [5 5 0 0] size [0.2 0.2 1] mass 3 )
"""


@pytest.fixture(params=["stage", "physical"])
def simulator(tmp_path, request):
    path = tmp_path / "mine.world"
    path.write_text(WORLD + f'semantics "{request.param}"\n')
    return Simulator(load_world(path), read_options(settings.load(shipped("launch/simulator.yaml"))))


def corners(piece, frame):
    """All corners of a piece in the map, its frame being there."""
    x, y, _, heading = frame
    c, s = np.cos(heading), np.sin(heading)
    return np.concatenate(piece.polygons) @ np.array([[c, s], [-s, c]]) + (x, y)


def test_pieces_are_where_the_world_has_them(simulator):
    pieces = {piece.name: piece for piece in scenery(simulator.machinery)}
    assert {name: piece.kind for name, piece in pieces.items() if piece.name in ("robot", "box", "long", "part")} == {
        "robot": "robot",
        "box": "obstacle",
        "long": "wall",
        "part": "wall",  # of a building, by its height
    }
    assert not pieces["long"].movable
    robot = pieces["robot"]
    assert len(robot.polygons) == 2  # what stands on it is part of it
    there = corners(robot, simulator.machinery.frames[robot.row])
    np.testing.assert_allclose([there.min(axis=0), there.max(axis=0)], [(0.9, 1.8), (1.1, 2.2)], atol=1e-9)
    assert bounds(pieces.values()) == pytest.approx((-4.0, -3.05, 5.1, 5.1))


def test_a_piece_is_moved_by_its_id(simulator):
    piece = next(piece for piece in scenery(simulator.machinery) if piece.name == "box")
    simulator.set_pose(piece.id, [2.0, 2.0, 0.0, 1.0])
    moved = next(piece for piece in scenery(simulator.machinery) if piece.name == "box")
    assert moved.id == piece.id
    np.testing.assert_allclose(moved.pose, [2.0, 2.0, 0.0, 1.0])
