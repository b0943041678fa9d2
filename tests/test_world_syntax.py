# SPDX-License-Identifier: BSD-3-Clause
"""Stage's language to the letter, our additions to it, and its limits."""

import os
from pathlib import Path

import numpy as np
import pytest

from kurumaisu.errors import Error, one_line
from kurumaisu.world import World, files, load_world, syntax, tree


def read(folder: Path, text: str | bytes, **values: str) -> World:
    path = folder / "t.world"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_world(path, values=values)


def sizes(world: World) -> list[list[float]]:
    return [model.size.tolist() for model in world.models]


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("model(size[1 2 3])", None),  # size[1 is one word
        ("model(size [1 2 3])", [1, 2, 3]),
        ("model\n\n# here it begins\n(\n size [1 2 3] )", [1, 2, 3]),
        ("model ( size [1 2 3 4 5] )", [1, 2, 3]),
        ("model ( size [1 2 3] size [4 5 6] )", [4, 5, 6]),
        ("model ( size [1 2 3]name 5mass 3 )", [1, 2, 3]),
        ("model ( size [+1 .5 -.5.7-] origin [0 0 0 0] )", None),  # below 0
        ("model ( size [+1 .5 5.7-] )", [1, 0.5, 5.7]),
        ('model ( size ["1e0" "2 m" "0x"] )', [1, 2, 0]),
        ("define a model ( size [9 9 9] )\ndefine b\na ( size [1 2 3] )\nb ( )", [1, 2, 3]),
        ("define a b ( size [1 2 3] )\ndefine b model ( size [9 9 9] )\na ( )", [1, 2, 3]),
        ("define a model ( wifi ( ) define b c ( ) )\nmodel ( size [1 2 3] )", [1, 2, 3]),  # never used, never read
        ("define block model ( size [1 2 3] )\nblock ( )", [1, 2, 3]),
        ("model ( size [1 2 3] ) mass [ 1 2", [1, 2, 3]),  # the end of the file closes a tuple
        (b"model ( size [1 2 3] ) # caf\xe9 \xff\xfe\x00 , : =", [1, 2, 3]),
        (b'model ( name "\xe9" size [1 2 3] )', [1, 2, 3]),
        ("model ( size [1 2 3]\r#\r)\r", [1, 2, 3]),
        ("model\n\r(\n\rsize [1 2 3] )", [1, 2, 3]),
    ],
)
def test_language(tmp_path: Path, text: str | bytes, size: list[float] | None) -> None:
    if size is None:
        with pytest.raises(Error):
            read(tmp_path, text)
    else:
        assert sizes(read(tmp_path, text))[0] == size


# Short texts of the kinds in Stage's own tests/worldfile: what its parser accepts is refused for `test 1` only.
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('test 1\nmap ( file "a" scale 0.03 )\nposition ( laser ( a() b( c ( ) ) ) )', "1:1: this is a test file"),
        (
            "define s sonar ( n 2 )\ntest 1\ndefine r position ( s ( ) p ( ) )\nr ( pose [1 2 0] )",
            "2:1: this is a test",
        ),
        ("include a.inc", "1:9: include needs a string, not a word a.inc"),
        ('include"a.inc"\n', "1:1: include needs a blank before its string"),
        ("test 1\nposition ( pose [1, 2] )", "2:19: ',' is not allowed"),
        ("position ( pose [1 2 3 0] \ntest 1\n", r"1:1: the '\(' of position is never closed"),
        ("position ( ) )", r"1:14: expected a property or an entity, not '\)'"),
        ("position ( name )", "1:12: name needs a value on its line"),
        ("position ( a b c )", "1:12: a needs a value on its line"),
        ("position ( pose\n[1 2 3 0] )", "1:12: pose needs a value on its line"),
        ("position ( pose # where\n[1 2 3 0] )", "1:12: pose needs a value on its line"),
        ("position ( define a b ( ) )", "1:12: define is allowed at the top level only"),
        ("position ( pose [1 2 [3] 0] )", r"1:22: pose needs a number or a string on its line, not '\['"),
        ("position ( pose [1 2 # three\n3 0] )", "1:29: pose needs .* not the end of the line"),
        ("position ( pose [a b] )", "1:18: pose needs a number or a string on its line, not a word a"),
        ("define a position ( pose [1 2] )\na ( )", "1:21: pose needs 4 numbers, not 2"),
        (b"position ( )\n\xef\xbb\xbf", "2:1: a byte order mark"),
        (b"position ( )\x0c", r"1:13: '\\x0c' is not allowed"),
        ("position = 3", "1:10: '=' is not allowed"),
        ("model ( size[1 2 3] )", r"1:13: a blank is missing before '\[': size"),
        ("position ( pose[0 0 0 0] size [1 1 1] )", r"1:16: a blank is missing before '\[': pose"),
        ("model ( block ( points 3 point[0][1 2] ) )", r"1:34: a blank is missing before '\[': point\[0\]"),
        ("model ( mass[5] )", r"1:9: mass\[5\] needs .*; if \[5\] is its value, a blank is missing"),
        ('\n<?xml version="1.0"?>\n<sdf/>', "2:1: this is XML"),
    ],
)
def test_what_stage_refuses(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(Error, match=rf"t\.world:{message}"):
        read(tmp_path, text)


def test_an_error_shows_its_line_with_a_caret(tmp_path: Path) -> None:
    with pytest.raises(Error) as caught:
        read(tmp_path, "model\n(\n\tsize [1 2, 3] # \x07 three\n)")
    place = f"{tmp_path}/t.world:3:11: "
    assert str(caught.value).splitlines() == [
        place + "',' is not allowed",
        "  | \tsize [1 2, 3] # \ufffd three",
        "  | \t         ^",
    ]
    assert one_line(caught.value) == place + "',' is not allowed"


def test_a_long_line_is_shown_in_part(tmp_path: Path) -> None:
    with pytest.raises(Error) as caught:
        read(tmp_path, "# " + "x" * 5000 + "\n" + "mass 1 " * 1000 + ", " + "mass 1 " * 1000)
    _, line, caret = str(caught.value).splitlines()
    assert len(line) < 250
    assert line[len(caret) - 1] == ","


def test_includes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    deep, path = tmp_path / "deep", tmp_path / "path"
    deep.mkdir()
    path.mkdir()
    monkeypatch.setenv("STAGEPATH", f":{tmp_path / 'none'}:{path}")
    (deep / "a.inc").write_text('include "b.inc" # beside it, which Stage does not find\n')
    (deep / "b.inc").write_text("size [1 1 1]")
    (tmp_path / "b.inc").write_text("size [2 2 2]")
    (path / "c.inc").write_text('include "d.inc"\n')
    (path / "d.inc").write_text("size [3 3 3] )\nmodel (")
    world = read(tmp_path, 'model ( include "deep/a.inc"\n)\nmodel ( include "nowhere/c.inc" ignored ( \n)')
    assert sizes(world) == [[2, 2, 2], [3, 3, 3], [0.4, 0.4, 1]]  # the top-level file's folder comes first
    assert any("what follows on the line of an include is not read" in warning for warning in world.warnings)
    (tmp_path / "b.inc").unlink()
    assert sizes(read(tmp_path, 'model ( include "deep/a.inc"\n)')) == [[1, 1, 1]]


@pytest.mark.parametrize("name", ["none.inc", "", ".", "a" * 5000, "\x01/x"])
def test_includes_that_are_not_there(tmp_path: Path, name: str) -> None:
    with pytest.raises(Error, match=r"t\.world:2:9: .*"):
        read(tmp_path, f'model ( )\ninclude "{name}"')


@pytest.mark.parametrize("text", ['include "pipe"', 'model ( bitmap "pipe" )', 'model ( bitmap "pipe.yaml" )'])
def test_a_pipe_is_no_file_of_a_world(tmp_path: Path, text: str) -> None:
    for name in ("pipe", "pipe.yaml"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(Error, match=r"pipe.*: must be a regular file, and is a pipe"):
        read(tmp_path, text)
    with pytest.raises(Error, match=r"pipe: must be a regular file, and is a pipe"):
        load_world(tmp_path / "pipe")


@pytest.mark.parametrize("text", ["pose [20000000 0 0 0]", "size [30000000 1 1]"])
def test_a_model_beyond_what_is_known_is_refused_at_its_place(tmp_path: Path, text: str) -> None:
    with pytest.raises(Error, match=r"t\.world:2:1: the model reaches .*e\+07 m"):
        read(tmp_path, f"\nmodel ( {text} )")


def test_warnings_are_cut(tmp_path: Path) -> None:
    (tmp_path / "a.inc").write_text("")
    (warning,) = read(tmp_path, f'include "a.inc" {"x" * 100_000}').warnings
    assert len(warning) < 500 + len(str(tmp_path))


def test_lenient_numbers_are_told(tmp_path: Path) -> None:
    world = read(tmp_path, 'model ( mass 1.2.3 obstacle_return "false" friction --5\nstack_children "2e-3" )')
    (model,) = world.models
    assert (model.mass, model.obstacle_return, model.friction, model.stack_children) == (1.2, False, 0, True)
    assert [warning.split("t.world:")[1] for warning in world.warnings] == [
        "1:14: mass: '1.2.3' is read as 1.2, as Stage does",
        "1:53: friction: '--5' is read as 0, as Stage does",
        "1:36: obstacle_return: 'false' is read as 0, as Stage does",
    ] or len(world.warnings) == 3


def test_units(tmp_path: Path) -> None:
    text = """unit_length "cm" unit_angle "radians" resolution 0.05
    position ( pose [100 200 5 1] size [10 20 30] origin [1 2 3 0.5] wheelbase 50 velocity_bounds [-1 1 -1 1 -1 1 -1 2]
      ranger ( sensor ( fov 2 range [10 500] noise [1 0.1 0.01] pose [1 1 1 1] size [1 1 1] ) )
      camera ( fov [60 50] range [20 800] pantilt [90 -10] ) bumper ( bcount 1 blength 20 bpose[0] [1 2 3 1] ) )
    """
    world = read(tmp_path, text)
    base, ranger, camera, bumper = world.models
    np.testing.assert_allclose(base.pose, [1, 2, 0.05, 1])
    np.testing.assert_allclose(base.origin, [0.01, 0.02, 0.03, 0.5])
    np.testing.assert_allclose(base.size, [0.1, 0.2, 0.3])
    assert world.resolution == 0.05  # libstage/world.cc reads it without the unit
    assert base.device is not None
    assert base.device.wheelbase == 0.5
    np.testing.assert_allclose(base.device.velocity_bounds[:, 0], [-0.01, -0.01, -0.01, -1])
    (fan,) = ranger.device.fans
    np.testing.assert_allclose([fan.fov, fan.range_min, fan.range_max, fan.height], [2, 0.1, 5, 0.01])
    np.testing.assert_allclose(fan.noise, [0.01, 0.1, 0.01])
    np.testing.assert_allclose(fan.pose, [0.01, 0.01, 0.01, 1])
    angles = [camera.device.fov_h, camera.device.fov_v, camera.device.pan, camera.device.tilt]
    np.testing.assert_allclose(angles, np.deg2rad([60, 50, 90, -10]))  # always degrees in Stage
    np.testing.assert_allclose([camera.device.near, camera.device.far], [0.2, 8])
    np.testing.assert_allclose(bumper.device.poses, [[0.01, 0.02, 0.03, 1]])
    np.testing.assert_allclose(bumper.device.lengths, [0.2])


def test_parameters(tmp_path: Path) -> None:
    text = 'name "${who}s room" # ${comment}\nmodel ( size [${width=2} ${depth} 1] ${more=} )'
    world = read(tmp_path, text, who="Ann", depth="3.5")
    assert world.name == "Anns room"
    assert sizes(world) == [[2, 3.5, 1]]
    (tmp_path / "a.inc").write_text("pose [${x} 0 0 0]")
    world = read(tmp_path, 'model ( include "${file}.inc"\n)', x="7", file="a")
    assert world.poses[0, 0] == 7


@pytest.mark.parametrize(
    ("text", "values", "message"),
    [
        ("model ( size [1 ${w} 1] )", {}, r"t\.world:1:17: the parameter w has no value here: give w=VALUE"),
        ('\nname "a ${w}"', {}, r"t\.world:2:9: the parameter w has no value"),
        ("model ( )", {"w": "1"}, r"t\.world: has no parameter \$\{w\}"),
        ("# ${w}", {"w": "1"}, r"t\.world: has no parameter \$\{w\}"),
        ("mass ${a b}", {}, r"t\.world:1:6: a parameter is written as"),
        ("mass ${a", {"a": "1"}, r"t\.world:1:6: a parameter is written as"),
        ("mass $a", {}, r"t\.world:1:6: '\$' is not allowed"),
        ("mass ${a}", {"a": "1\n2"}, r"t\.world:1:6: the value of the parameter a has more than one line"),
        ("mass ${a}", {"a": ","}, r"t\.world:1:6: ',' is not allowed"),
    ],
)
def test_bad_parameters(tmp_path: Path, text: str, values: dict[str, str], message: str) -> None:
    with pytest.raises(Error, match=message):
        read(tmp_path, text, **values)


def doubled(levels: int, body: str) -> str:
    """Return macros of macros that come to 2^levels bodies."""
    lines = [f"define m0 model ( {body} )"]
    lines += [f"define m{i} model ( m{i - 1} ( ) m{i - 1} ( ) )" for i in range(1, levels)]
    return "\n".join([*lines, f"m{levels - 1} ( )"])


BOMBS = {  # by name, for the texts are too long to be a test's name
    "brackets": ("a(" * 10**7, "more than 1000 levels of brackets"),
    "entities": ("a(" * 900 + ")" * 900, "more than 100 levels of entities"),
    "second brackets": ("model (" + "(" * 400 + ")", "more than 100 levels of models"),
    "macro in itself": ("define a model ( a ( ) )\na ( )", "more than 100 levels"),
    "macro chain": ("\n".join(f"define m{i + 1} m{i} ( )" for i in range(1000)) + "\nm1000 ( )", "never ends"),
    "models": (doubled(60, ""), "more than 1000 models"),
    "windows": (doubled(60, "").replace("model", "window"), "the macros come to more than 10000 entities"),
    "sensors": (
        "define a ranger (" + "sensor ( )\n" * 500 + ")\n" + "a ( )\n" * 500,
        "come to more than 10000 properties",
    ),
    "macros": (
        "define a model (" + "".join(f"m{i} 1 " for i in range(800)) + ")\n" + "a ( )\n" * 20,
        "come to more than 10000 properties",
    ),
    "words": ("mass 1\n" * 4000, "more than 10000 words"),
    "blanks": ("mass 1 " + " " * 10**6 + ",", "',' is not allowed"),
}


@pytest.mark.parametrize(("text", "message"), BOMBS.values(), ids=BOMBS)
def test_bombs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, message: str) -> None:
    monkeypatch.setattr(files, "_MOST_TOKENS", 10_000)
    monkeypatch.setattr(syntax, "_MOST_STEPS", 10_000)
    monkeypatch.setattr(tree, "_MOST_MODELS", 1_000)
    monkeypatch.setattr(tree, "_MOST_ENTITIES", 10_000)
    with pytest.raises(Error, match=message):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model ( block ( points 1000000000 ) )", "points must be 0 to"),
        ("ranger ( sensor ( samples 1000001 ) )", "samples must be 1 to"),
        ("ranger ( sensor ( samples 0 ) )", "samples must be 1 to"),
        ("ranger ( sensor ( range [0 0] ) )", "range must be"),
        ("ranger ( sensor ( range [3 2] ) )", "range must be"),
        ("camera ( resolution [100000 100000] )", "resolution must be"),
        ("camera ( resolution [0 10] )", "resolution must be"),
        ("camera ( fov [0 10] )", "fov must be"),
        ("camera ( range [1 1] )", "range must be"),
        ("bumper ( bcount -1 )", "bcount must be"),
        ("bumper ( bcount 1000000 )", "bcount must be"),
        ("gripper ( paddle_size [0 0 0] )", "paddle_size must be"),
        ('gripper ( paddle_state "closed" )', "paddle_state needs 2 strings"),
        ("position ( wheelbase 0 )", "wheelbase must be"),
        ("resolution 0", "resolution must be"),
        ("interval_sim 0", "interval_sim must be"),
        ("interval_sim -5", "interval_sim must be"),
        ("model ( pose [" + "9" * 40 + " 0 0 0] )", "pose needs a number of at most"),
        ('model ( pose ["1e999" 0 0 0] )', "pose needs a number of at most"),
        ('model ( mass "nan" )', None),
        ("model ( mass -1 )", "mass must not be below 0"),
        ("model ( update_interval -1 )", "update_interval must not be below 0"),
        ("model ( hinge [0 0 90 -90] )", "hinge must be"),
        ("model ( hinge [0 0 90] )", "hinge needs 4 numbers, not 3"),
        ("model ( size [1 1 -1] )", "size must not be below 0"),
    ],
)
def test_limits(tmp_path: Path, text: str, message: str | None) -> None:
    if message is None:
        read(tmp_path, text)  # the string is no number, so 0
    else:
        with pytest.raises(Error, match=message):
            read(tmp_path, text)


def test_include_bombs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "_MOST_TOKENS", 10_000)
    for i in range(40):
        (tmp_path / f"{i}.inc").write_text(f'include "{i + 1}.inc"\n' * 2)
    (tmp_path / "40.inc").write_text("mass 1\n" * 10)
    with pytest.raises(Error, match="more than 10000 words"):
        read(tmp_path, 'include "0.inc"')


def test_endless_files(tmp_path: Path) -> None:
    with pytest.raises(Error, match="must be a regular file, and is a device"):
        load_world(Path("/dev/zero"))
    with pytest.raises(Error, match="directory"):
        load_world(tmp_path)


def test_many_warnings_come_to_an_end(tmp_path: Path) -> None:
    world = read(tmp_path, "\n".join(f"unknown{i} 1" for i in range(5000)) + " quit_time -1")
    assert len(world.warnings) == 201
    assert world.quit_time == 0  # -1 is never, as in Stage
