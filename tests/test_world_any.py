# SPDX-License-Identifier: BSD-3-Clause
"""Any input is a world or an Error, within bounds; worlds of others are read from a folder if there is one."""

import contextlib
import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from kurumaisu.errors import Error
from kurumaisu.world import World, files, load_world, syntax, tree

RICH = """
resolution 0.02 interval_sim 50 unit_angle "degrees"
define wall model ( color "gray30" size [1 0.1 0.5] gui_nose 0 )
define long wall ( size [4 0.1 0.5] )
define las ranger ( sensor ( range [0.1 8] fov 270.25 samples 181 noise [0.01 0.02 3] size [.1 .1 .3] ) )
define bot position ( size [0.4 0.3 0.2] origin [-0.1 0.02 0.01 30] drive "omni" las ( pose [0.1 0 -0.05 10] ) )
wall ( pose [1 2 0 45] ) long ( pose [ -1 -2 0.1 -400 ] name "w" hinge [0 0 -90 90] )
bot ( pose [0 0 0 90] name "r0" mass 3 velocity [0.1 0 0 5] )
bot ( stack_children 0 model ( pose [0 0 0 5] ) drive "car" wheelbase 0.5 camera ( range [0.1 9] ) )
model ( size [9 5 3] boundary 1
  block ( points 4 point[0] [0 0] point[1] [1 0] point[2] [1 1] point[3] [0 1] z [0 2] )
  block ( points 3 point[0] [2 0] point[1] [2 2] point[2] [3 0] z [1 3] ) )
model ( bitmap "b.png" size [2 1 0.5] boundary 1 ranger_return -1 obstacle_return 0 )
gripper ( paddle_size [0.5 0.2 0.3] paddle_state ["closed" "down"] ) bumper ( bcount 1 blength 0.2 )
fiducial ( range_max 5 ) window ( size [10 10] ) # comment
"""
PIECES = re.findall(r'"[^"\n]*"|[A-Za-z][\w.\-\[\]]*|[-+.\d]+|[()\[\]\n]|#[^\n]*|[ \t]+', RICH)
OTHERS = [
    "include ",
    '"a.inc"',
    "define ",
    "test ",
    "1e-3",
    "--",
    '""',
    "((",
    "${a}",
    "\0",
    "\r",
    "é",
    "9" * 30,
    "-1",
    "0",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("any")
    Image.fromarray(np.eye(9, dtype=np.uint8) * 255).save(made / "b.png")
    (made / "a.inc").write_text(RICH)
    return made


def attempt(folder: Path, content: bytes) -> World | None:
    path = folder / "t.world"
    path.write_bytes(content)
    with pytest.MonkeyPatch.context() as patch, contextlib.suppress(Error):  # anything else is a fault
        patch.setattr(files, "_MOST_TOKENS", 20_000)
        patch.setattr(syntax, "_MOST_STEPS", 20_000)
        patch.setattr(tree, "_MOST_MODELS", 1_000)
        world = load_world(path)
        assert world.poses.shape == (len(world.models), 4)
        assert np.isfinite(world.poses).all()
        for model in world.models:
            assert -1 <= model.parent < model.index
            assert model.root == (world.models[model.parent].root if model.parent >= 0 else model.index)
            assert np.isfinite(model.shape.segments).all()
            assert len(model.shape.segments) == len(model.shape.heights)
        return world
    return None


def test_the_rich_world_loads(folder: Path) -> None:
    world = attempt(folder, RICH.encode())
    assert world is not None
    assert len(world.models) == 13


@given(content=st.binary(max_size=120))
def test_any_bytes(folder: Path, content: bytes) -> None:
    attempt(folder, content)


@given(pieces=st.lists(st.sampled_from([*PIECES, *OTHERS]), max_size=60))
def test_any_words(folder: Path, pieces: list[str]) -> None:
    attempt(folder, " ".join(pieces).encode())


@settings(max_examples=120)
@given(data=st.data())
def test_mutated_worlds(folder: Path, data: st.DataObject) -> None:
    pieces = list(PIECES)
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(pieces) - 1))
        pieces[at : at + data.draw(st.integers(0, 2))] = data.draw(
            st.lists(st.sampled_from([*PIECES, *OTHERS]), max_size=2)
        )
    attempt(folder, "".join(pieces).encode())


# What Stage 4.3 loads, and what not: types wifi, laser and map do not exist. Some folders have their own copies.
REFUSED = re.compile(r"wifi|/pss|/tests/|map\.inc|examples")
FOLDERS = os.environ.get("KURUMAISU_STAGE_WORLDS", "")


@pytest.mark.skipif(not FOLDERS, reason="KURUMAISU_STAGE_WORLDS names no folders of Stage worlds")
def test_worlds_of_stage() -> None:
    paths = [path for folder in FOLDERS.split(":") for path in sorted(Path(folder).rglob("*.world"))]
    assert paths
    surprises = []
    for path in paths:
        try:
            load_world(path)
            loaded = True
        except Error as error:
            loaded = False
            reason = str(error)
        if loaded == bool(REFUSED.search(str(path))):
            surprises.append(f"{path} loads" if loaded else reason)
    assert not surprises
