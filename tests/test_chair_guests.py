# SPDX-License-Identifier: BSD-3-Clause
"""Things that come to the chair's world, go, and come back: what is seen and bumped into, and one input, one run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_chair_world import EXACT, FRONT, among, drive, where

from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting
from kurumaisu.sim.chair.simulator import ChairSimulator
from kurumaisu.sim.robots.newcomers import newcomers
from kurumaisu.world import load_world

WALL = 'model ( name "board" size [0.1 2 1] )'
ROOM = 'model ( name "far" pose [8 0 0 0] size [0.2 6 2] )'


def add(simulator: ChairSimulator, folder: Path, text: str, pose: list[float], name: str = "") -> str:
    there = simulator.machinery.population
    vocabulary = load_world(folder / "t.world").vocabulary
    return simulator.spawn(newcomers(text, name, there.models, there.index, vocabulary).models, pose)


def ahead(simulator: ChairSimulator) -> float:
    """Return what the beam straight ahead reads in the next scan [m]."""
    return next(float(o.scan.ranges[o.scan.ranges.size // 2]) for o in drive(simulator, 0, 0, 0.3)[20:] if o.scan)


def test_what_comes_is_seen_and_bumped_into_and_gone_when_it_is_taken_away(tmp_path):
    simulator = among(tmp_path, ROOM, EXACT)
    far = ahead(simulator)
    key = add(simulator, tmp_path, WALL, [2.0, 0.0, 0.0, 0.0])
    assert far - ahead(simulator) == pytest.approx(8 - 0.1 - (2 - 0.05), abs=0.01)
    assert drive(simulator, 0.5, 0.0, 5.0)[-1].pose[0] == pytest.approx(2 - 0.05 - FRONT, abs=0.01)
    simulator.delete(key)
    assert drive(simulator, 0.5, 0.0, 2.0)[-1].pose[0] > 2.0


def test_what_was_deleted_comes_back_under_its_number_to_where_it_was(tmp_path):
    simulator = among(tmp_path, f'{ROOM}\nmodel ( name "box" pose [1.3 0 0 0] size [0.4 0.4 0.6] mass 5 )')
    drive(simulator, 0.5, 0.0, 2.0)
    pushed = where(simulator, "box").copy()
    key = "#" + str(simulator.machinery.population.keys[simulator.machinery.population.index("box")])
    simulator.delete("box")
    other = add(simulator, tmp_path, WALL, [-3.0, 0.0, 0.0, 0.0])
    assert other != key
    simulator.restore(key)
    np.testing.assert_array_equal(where(simulator, "box"), pushed)
    simulator.set_pose(key, [3.0, 1.0, 0.0, 0.0])
    assert where(simulator, "box")[0] == 3.0
    with pytest.raises(Error, match=f"model {key}: was not deleted"):
        simulator.restore(key)


def test_what_cannot_be_is_refused_and_nothing_has_changed(tmp_path):
    simulator = among(tmp_path, f'{ROOM}\nposition ( name "other" pose [4 2 0 0] )')
    drive(simulator, 0.3, 0.0, 0.5)
    before = simulator.state_hash()
    with pytest.raises(Error, match="the chair is in the way: it would overlap board"):
        add(simulator, tmp_path, WALL, [0.3, 0.0, 0.0, 0.0])
    with pytest.raises(Error, match="guest: a robot cannot come"):
        add(simulator, tmp_path, 'position ( name "guest" )', [3.0, 0.0, 0.0, 0.0])
    with pytest.raises(Error, match="name 'far': there is a model of this name"):
        add(simulator, tmp_path, WALL, [3.0, 0.0, 0.0, 0.0], name="far")
    with pytest.raises(Error, match="pose: must be"):
        add(simulator, tmp_path, WALL, [1e9, 0.0, 0.0, 0.0])
    for name in ("chair", "other"):
        with pytest.raises(Error, match=f"{name}: a robot cannot leave"):
            simulator.delete(name)
    with pytest.raises(Error, match="there is none of this name"):
        simulator.delete("nobody")
    assert simulator.state_hash() == before


def test_a_model_in_whose_place_the_chair_is_does_not_come_back(tmp_path):
    simulator = among(tmp_path, 'model ( name "board" pose [1.5 0 0 0] size [0.1 2 1] )')
    simulator.delete("board")
    drive(simulator, 0.5, 0.0, 3.0)
    with pytest.raises(Error, match="the chair is in the way: it would overlap board"):
        simulator.restore("board")
    drive(simulator, 0.5, 0.0, 3.0)
    simulator.restore("board")
    assert where(simulator, "board")[0] == 1.5


def test_the_same_inputs_are_the_same_run_and_a_saved_one_goes_on(tmp_path):
    def run(simulator: ChairSimulator) -> ChairSimulator:
        drive(simulator, 0.4, 0.1, 0.5)
        key = add(simulator, tmp_path, 'model ( name "box" size [0.4 0.4 0.6] mass 5 )', [1.4, 0.1, 0.0, 0.3])
        drive(simulator, 0.5, 0.0, 1.0)
        simulator.delete(key)
        return simulator

    one, two = (run(among(tmp_path, ROOM)) for _ in range(2))
    assert one.state_hash() == two.state_hash()
    loaded = among(tmp_path, ROOM)
    loaded.load(one.save())
    for simulator in (one, loaded):
        simulator.restore("box")
        drive(simulator, 0.5, 0.0, 1.0)
    assert one.state_hash() == loaded.state_hash()
    assert [m.name for m in one.models] == ["chair", "far", "box"]
    one.reset(1)
    assert one.state_hash() == among(tmp_path, ROOM).state_hash()


def test_walls_that_an_effect_has_moved_would_all_move_again(tmp_path):
    simulator = among(tmp_path, ROOM)
    simulator.switch((EffectSetting("world.map_error", {"scale": 0.0, "sd": 0.01}),))
    with pytest.raises(Error, match=r"world\.map_error acts"):
        add(simulator, tmp_path, WALL, [3.0, 0.0, 0.0, 0.0])
    add(simulator, tmp_path, 'model ( name "box" size [0.4 0.4 0.6] mass 5 )', [3.0, 0.0, 0.0, 0.0])
