# SPDX-License-Identifier: BSD-3-Clause
"""What is blocked rests, and that it is not computed again changes nothing."""

import numpy as np
import pytest
from physics_scene import DT, DYNAMICS, box, room, thing, walls

from kurumaisu.sim.motion import island
from kurumaisu.sim.motion.physical import PhysicalMotion


@pytest.mark.parametrize("heading", [0.0, 0.3, -0.01])
def test_a_blocked_robot_does_not_creep(heading: float) -> None:
    moved = PhysicalMotion([box()], walls((1, -3, 1, 3)), DYNAMICS)
    moved.place(np.array([[0.0, 0.0, 0.0, heading]]))
    poses = [moved.move(np.array([[0.5, 0.0, 0.0]]), DT)[0] for _ in range(100)]
    assert poses[30].tolist() == poses[99].tolist()


def test_one_that_drives_slowly_is_not_taken_for_one_that_rests() -> None:
    """1 um/s against a box, for 10 s."""
    moved = PhysicalMotion([box(), thing(1)], walls(), DYNAMICS)
    gap = 2 * DYNAMICS.contacts.collision_slop  # nothing closer counts as free
    moved.place(np.array([[0.0, 0.0, 0.0, 0.0], [0.4 + gap, 0.0, 0.0, 0.0]]))
    moved.move(np.array([[gap / DT, 0.0, 0.0], [0.0, 0.0, 0.0]]), DT)
    before = moved.poses
    for _ in range(100):
        moved.move(np.array([[1e-6, 0.0, 0.0], [0.0, 0.0, 0.0]]), DT)
    assert moved.poses[0, 0] - before[0, 0] == pytest.approx(1e-5, rel=0.01)


def test_what_rests_is_computed_once_and_comes_to_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots against walls, a box and each other; one simulation forgets after each step what it knows."""
    runs = []
    run = island.Island.run
    monkeypatch.setattr(island.Island, "run", lambda self, *given: (runs.append(1), run(self, *given))[1])
    rng = np.random.default_rng(5)
    rigids = [*(box(tree=i) for i in range(4)), thing(4)]
    places = np.array([(0.0, -1.2 + 0.8 * i, 0.0, 0.0) for i in range(4)] + [(0.8, 0.0, 0.0, 0.0)])
    commands = [
        np.vstack([rng.uniform(0.3, 1, (4, 3)) * [1, side, side], np.zeros((1, 3))]) for side in (0.0, -0.3, 0.0)
    ]
    remembers, forgets = (PhysicalMotion(rigids, room(1.6), DYNAMICS) for _ in range(2))
    counts = []
    for moved in (remembers, forgets):
        moved.place(places)
        before = len(runs)
        for command in commands:
            for _ in range(30):
                moved.move(command, DT)
                if moved is forgets:
                    moved.restore(moved.state())
        counts.append(len(runs) - before)
    for name, values in remembers.state().items():
        assert values.tobytes() == forgets.state()[name].tobytes(), name
    assert counts[0] < 0.8 * counts[1]
