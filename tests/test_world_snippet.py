# SPDX-License-Identifier: BSD-3-Clause
"""Models from a text in the words of a world that is there, and how a world wants to be simulated."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sim_worlds import ROOM, drive, robot, simulator

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim import Simulator, load_options
from kurumaisu.world import World, load_world, read_snippet
from kurumaisu.world.model import Ranger

MACROS = """
unit_length "cm"
define eye ranger ( sensor ( range [0 ${reach=500}] samples 3 fov 90 ) )
define cart position ( size [40 30 20] eye ( pose [10 0 0 0] ) )
cart ( name "first" )
"""


def world(folder: Path, text: str = MACROS, **values: str) -> World:
    path = folder / "a.world"
    path.write_text(text)
    return load_world(path, values=values)


def test_the_macros_units_and_parameters_of_the_file_hold(tmp_path: Path) -> None:
    known = world(tmp_path, reach="300")
    (cart, eye) = read_snippet('cart ( name "guest" size [50 30 20] )', known.vocabulary).models
    assert (cart.index, cart.parent, cart.root, cart.name) == (0, -1, 0, "guest")
    np.testing.assert_allclose(cart.size, [0.5, 0.3, 0.2])
    np.testing.assert_allclose(eye.pose, [0.1, 0, 0, 0])
    assert isinstance(eye.device, Ranger)
    assert eye.device.fans[0].range_max == pytest.approx(3.0)


def test_a_text_may_have_units_of_its_own(tmp_path: Path) -> None:
    known = world(tmp_path)
    text = 'unit_length "m" unit_angle "radians" model ( pose [1 0 0 0.5] size [2 1 1] )'
    (model,) = read_snippet(text, known.vocabulary).models
    np.testing.assert_allclose((*model.pose, *model.size), [1, 0, 0, 0.5, 2, 1, 1])
    (model,) = read_snippet("model ( pose [1 0 0 180] size [2 1 1] )", known.vocabulary).models
    np.testing.assert_allclose((*model.pose, *model.size), [0.01, 0, 0, np.pi, 0.02, 0.01, 0.01])


def test_a_text_may_define_and_the_world_does_not_learn_it(tmp_path: Path) -> None:
    known = world(tmp_path)
    text = "define tall cart ( size [40 30 90] )\ntall ( )"
    for _ in range(2):
        assert read_snippet(text, known.vocabulary).models[0].size[2] == pytest.approx(0.9)
    with pytest.raises(Error, match="tall is not a type of model"):
        read_snippet("tall ( )", known.vocabulary)


def test_a_text_may_include_and_have_bitmaps_from_beside_the_world(tmp_path: Path) -> None:
    (tmp_path / "more.inc").write_text("define tower model ( size [10 10 300] )")
    (model,) = read_snippet('include "more.inc"\ntower ( )', world(tmp_path).vocabulary).models
    assert model.size[2] == pytest.approx(3.0)
    with pytest.raises(Error, match=r"text:1:9: .*none\.png: No such file"):
        read_snippet('model ( bitmap "none.png" )', world(tmp_path).vocabulary)


@pytest.mark.parametrize(("text", "place", "message", "caret"), [
    ("cart (\n  size [1, 2] )", "2:10", "',' is not allowed", "  size [1, 2] )\n  |          ^"),
    ("wheel ( )", "1:1", "wheel is not a type of model", "wheel ( )\n  | ^"),
    ("cart ( size [1 2] )", "1:8", "size needs 3 numbers, not 2", "^"),
    ("cart (", "1:1", "the '(' of cart is never closed", "^"),
    ("cart ( )\ninterval_sim 5", "2:1", "interval_sim would be of the whole world", "interval_sim 5\n  | ^"),
    ("# nothing", "1:1", "there is no model in the text", "^"),
    ("cart ( name ${who} )", "1:13", "the parameter who has no value here", "^"),
])  # fmt: skip
def test_what_is_wrong_is_shown(tmp_path: Path, text: str, place: str, message: str, caret: str) -> None:
    known = world(tmp_path)
    with pytest.raises(Error) as error:
        read_snippet(text, known.vocabulary)
    assert f"{tmp_path / 'text'}:{place}: " in str(error.value)
    assert message in str(error.value)
    assert str(error.value).endswith(caret)


def test_too_long_a_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Error, match="text: is longer than 1048576 characters"):
        read_snippet(" " * 2_000_000, world(tmp_path).vocabulary)


@given(st.text(alphabet='cart model()[]"\n#12.-$define', max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        models = read_snippet(text, HALL.vocabulary).models
    except Error:
        return
    assert models


HALL = load_world(shipped("worlds/hall.world"))


def test_a_robot_is_spawned_from_text_and_warnings_are_kept(tmp_path: Path) -> None:
    sim = simulator(tmp_path, "define laser ranger ( sensor ( range [0 20] samples 1 ) )\n" + ROOM + robot())
    sim.spawn('position ( name "guest" size [0.2 0.2 0.2] laser ( wheels 4 ) )', [1, 3, 0, 0])
    assert [r.name for r in sim.robots] == [None, "guest"]
    assert [w for w in sim.warnings if "wheels is not a property" in w]
    np.testing.assert_allclose(drive(sim, (0.1, 0, 0), 1)[-1].poses[1], [1.01, 3, 0, 0])
    assert sim.observe().scans[0].ranges[0] == pytest.approx(4)
    with pytest.raises(Error, match=r"text:1:1: must be one model with all that stands on it"):
        sim.spawn("model ( ) model ( )", [0, 0, 0, 0])


def test_a_map_alone_takes_models_too(tmp_path: Path) -> None:
    hall = load_world(shipped("worlds/maps/room.yaml"))
    assert hall.semantics == "stage"
    assert read_snippet("position ( )", hall.vocabulary).models[0].type == "position"


def test_a_world_says_how_it_wants_to_be_simulated(tmp_path: Path) -> None:
    assert world(tmp_path, "model ( )").semantics == "stage"
    assert world(tmp_path, 'semantics "physical"').semantics == "physical"
    with pytest.raises(Error, match=r"a\.world:1:1: semantics must be one of stage, physical, not 'both'"):
        world(tmp_path, 'semantics "both"')


@pytest.mark.parametrize("path", sorted(shipped("worlds/room.world").parent.glob("*.world")), ids=lambda p: p.stem)
def test_our_own_worlds_are_physical(path: Path) -> None:
    shown = load_world(path)
    assert shown.semantics == "physical"
    assert shown.warnings == ()


def test_the_options_have_the_last_word(tmp_path: Path) -> None:
    box = 'semantics "physical"\nmodel ( pose [0.6 0 0 0] size [0.4 0.4 1] mass 1 )' + robot("mass 20")
    pushed = {}
    for semantics in ("world", "stage", "physical"):
        sim = simulator(tmp_path, box, semantics=semantics)
        drive(sim, (0.5, 0, 0), 20)
        pushed[semantics] = bool(sim.model_poses[0, 0] > 0.7)
    assert pushed == {"world": True, "stage": False, "physical": True}
    options = load_options(shipped("launch/simulator.yaml"))
    late = Simulator(world(tmp_path, box), options)
    drive(late, (0.5, 0, 0), 1)
    assert late.observe().odometry[0, 0] == late.observe().poses[0, 0]  # consistent
