# SPDX-License-Identifier: BSD-3-Clause
"""Saved states are in one folder, and nothing else there is written over."""

import os
from pathlib import Path

import pytest

from kurumaisu.errors import Error
from kurumaisu.sim.robots import state
from kurumaisu.sim.robots.state_folder import StateFolder

SAVED = state.pack({"a": 1})


def test_a_state_is_written_read_and_replaced(tmp_path: Path) -> None:
    states = StateFolder(tmp_path / "states")
    for name in ("a", "below/b", str(tmp_path / "states/c")):
        path = states.write(name, SAVED)
        assert (tmp_path / "states") in path.parents
        assert states.read(name) == SAVED
        states.write(name, state.pack({"a": 2}))
        assert state.unpack(states.read(name)) == {"a": 2}


@pytest.mark.parametrize("name", ["", ".", "..", "../a", "a/../../b", "/etc/passwd", "out/a", "out", "loop/a", "a\0b"])
def test_names_that_lead_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    folder, outside = tmp_path / "states", tmp_path / "outside"
    folder.mkdir()
    outside.mkdir()
    (folder / "out").symlink_to(outside)
    (folder / "loop").symlink_to("loop")
    states = StateFolder(folder)
    with pytest.raises(Error):
        states.write(name, SAVED)
    with pytest.raises(Error):
        states.read(name)
    assert not list(outside.iterdir())
    assert sorted(path.name for path in folder.iterdir()) == ["loop", "out"]


def test_what_is_no_state_stays(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("not a state")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    states = StateFolder(tmp_path)
    for name, why in (("notes.txt", "is no saved state"), ("pipe", "is a pipe"), ("folder", "Is a directory")):
        with pytest.raises(Error, match=why):
            states.write(name, SAVED)
    assert (tmp_path / "notes.txt").read_text() == "not a state"
    with pytest.raises(Error, match="is a pipe"):
        states.read("pipe")
    with pytest.raises(Error, match="No such file"):
        states.read("none")
