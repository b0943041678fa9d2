# SPDX-License-Identifier: BSD-3-Clause
"""What is said of a name that there is not."""

import pytest

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.names import hint, nearest
from kurumaisu.params import shipped
from kurumaisu.program import Parser
from kurumaisu.world import load_world

EFFECTS = [effect.id for effect in effects.ALL]
PAGE = "docs/effects.md"


@pytest.mark.parametrize(
    ("name", "names", "near"),
    [
        ("base.gian_v", EFFECTS, ["base.gain_v", "base.gain_w"]),
        ("laser.ofset", EFFECTS, ["laser.offset"]),
        ("spin", ["creep", "spin_both_ways", "spin_three_speeds"], ["spin_both_ways", "spin_three_speeds"]),
        ("Sena", ["office", "sena", "urg"], ["sena"]),
        ("run_3", ["run_1", "run_1"], ["run_1"]),
        ("zzz", EFFECTS, []),
        ("", ["a"], []),
    ],
)
def test_near_names_come_first(name, names, near):
    found = nearest(name, names)
    assert found[: len(near)] == near
    assert len(found) <= 3
    assert bool(found) == bool(near)


def test_a_hint_is_short():
    assert hint("base.gian_v", EFFECTS, PAGE).startswith("did you mean base.gain_v or ")
    assert hint("zzz", EFFECTS, PAGE) == f"there are {len(EFFECTS)}: {PAGE}"
    assert hint("zzz", [f"robot{i}" for i in range(40)]) == "there are 40: robot0, robot1, robot2, ..."
    assert hint("zzz", ["run_1", "run_2"]) == "there are: run_1, run_2"
    assert hint("zzz", []) == "there is none"


def test_a_parser_hints(capsys):
    parser = Parser(prog="riddles")
    parser.add_argument("name", choices=["figure9", "offset", "equation2"])
    with pytest.raises(SystemExit, match="2"):
        parser.parse_args(["figure8"])
    assert capsys.readouterr().err.endswith("there is no 'figure8'; did you mean figure9?\n")


def test_a_part_of_a_program_hints(capsys):
    parser = Parser(prog="paper")
    parts = parser.add_subparsers(required=True, metavar="FIGURES")
    for part in ("drive", "wall", "conjecture"):
        parts.add_parser(part)
    with pytest.raises(SystemExit, match="2"):
        parser.parse_args(["drvie"])
    assert capsys.readouterr().err.endswith("there is no 'drvie'; did you mean drive?\n")


def test_a_world_that_is_not_there_has_near_names():
    with pytest.raises(Error, match=r"bulding\.world: No such file or directory; did you mean building\.world"):
        load_world(shipped("worlds/building.world").with_name("bulding.world"))
