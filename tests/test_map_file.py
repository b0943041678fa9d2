# SPDX-License-Identifier: BSD-3-Clause
"""Maps of map_server: read against values worked out by hand, written against PIL and PyYAML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from kurumaisu.errors import Error
from kurumaisu.map_file import MapFile, map_pair, read_map
from kurumaisu.whole_files import write_whole

LINES = {
    "image": "image.png",
    "resolution": "0.05",
    "origin": "[-1.0, 2.5, 0.3]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def write(folder: Path, pixels: object, **changes: str | None) -> Path:
    """Write an image and its YAML file; a change of None leaves the key out."""
    Image.fromarray(np.array(pixels, dtype=np.uint8)).save(folder / "image.png")
    lines = {**LINES, **changes}
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in lines.items() if value is not None))
    return path


def cells(path: Path) -> list[list[int]]:
    return read_map(path).cells.tolist()


def test_rows_start_at_the_bottom_and_the_origin_has_a_heading(tmp_path: Path) -> None:
    read = read_map(write(tmp_path, [[0, 254], [254, 205]]))
    assert read.cells.tolist() == [[0, -1], [100, 0]]
    assert read.cells.dtype == np.int8
    assert read.resolution == 0.05
    assert read.origin == (-1.0, 2.5, 0.3)


# (255 - shade) / 255: 89 is 0.651, 90 is 0.647, 205 is 0.19608, 206 is 0.192; 1 + 98 * (0.5019 - 0.196) / 0.454 = 67.04
SHADES = [[0, 89, 90, 127, 205, 206, 255]]


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({}, [100, 100, -1, -1, -1, 0, 0]),
        ({"mode": "trinary"}, [100, 100, -1, -1, -1, 0, 0]),
        ({"mode": "scale"}, [100, 100, 98, 67, 1, 0, 0]),
        ({"negate": "1"}, [0, -1, -1, -1, 100, 100, 100]),
        ({"negate": "true"}, [0, -1, -1, -1, 100, 100, 100]),
        ({"occupied_thresh": "0.9"}, [100, -1, -1, -1, -1, 0, 0]),
        ({"free_thresh": "0.55"}, [100, 100, -1, 0, 0, 0, 0]),
    ],
)
def test_shades(tmp_path: Path, changes: dict[str, str], wanted: list[int]) -> None:
    assert cells(write(tmp_path, SHADES, **changes)) == [wanted]


def test_raw_shades_are_occupancies(tmp_path: Path) -> None:
    assert cells(write(tmp_path, [[0, 1, 50, 100, 101, 255]], mode="raw")) == [[0, 1, 50, 100, -1, -1]]


def test_colours_are_averaged_and_what_shines_through_is_unknown(tmp_path: Path) -> None:
    assert cells(write(tmp_path, [[[255, 255, 0], [0, 0, 0], [255, 255, 255]]])) == [[-1, 100, 0]]
    clear = [[[100, 100, 100, 0], [100, 100, 100, 255], [0, 0, 0, 0]]]
    assert cells(write(tmp_path, clear, mode="scale")) == [[-1, 89, 100]]


def test_16_bits(tmp_path: Path) -> None:
    path = write(tmp_path, [[0]])
    Image.fromarray(np.array([[0, 65535]], dtype=np.uint16)).save(tmp_path / "image.png")
    assert cells(path) == [[100, 0]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"resolution": "0"}, "map.yaml:2: resolution: must be a finite number above 0: 0"),
        ({"resolution": "1e-2"}, "map.yaml:2: resolution: must be a number, not str '1e-2'"),
        ({"resolution": "1.0e+300"}, "map.yaml:2: resolution: must be a number from 0.0001 to 100 m: 1e+300"),
        ({"origin": "[1.0e+300, 0, 0]"}, "map.yaml:3: origin[0]: must be a number from -1e+07 to 1e+07 m: 1e+300"),
        ({"origin": "[1, 2]"}, "map.yaml:3: origin: must be a list of 3 numbers"),
        ({"negate": "2"}, "map.yaml:4: negate: must be 0 or 1: 2"),
        ({"occupied_thresh": "65"}, "map.yaml:5: occupied_thresh: must be from 0 to 1: 65"),
        ({"free_thresh": "0.7"}, "map.yaml:6: free_thresh: must be below occupied_thresh 0.65: 0.7"),
        ({"free_thresh": ".nan"}, "map.yaml:6: free_thresh: must be a finite number"),
        ({"mode": "fancy"}, "map.yaml:7: mode: must be one of trinary, scale, raw: 'fancy'"),
        ({"colour": "1"}, "map.yaml:7: colour: is not a known key"),
        ({"image": None}, "map.yaml: image: is missing"),
        ({"image": "none.png"}, "none.png: No such file or directory"),
        ({"image": "map.yaml"}, "map.yaml: "),
        ({"negate": "[\n"}, "map.yaml:"),
    ],
)
def test_what_is_wrong_is_named_with_file_line_and_key(
    tmp_path: Path, changes: dict[str, str | None], message: str
) -> None:
    with pytest.raises(Error) as caught:
        read_map(write(tmp_path, [[0]], **changes))
    assert str(caught.value).startswith(f"{tmp_path}/{message}")


def test_a_missing_map_is_named(tmp_path: Path) -> None:
    with pytest.raises(Error, match=r"none\.yaml: No such file"):
        read_map(tmp_path / "none.yaml")


@pytest.mark.parametrize("suffix", [".pgm", ".png"])
def test_round_trip(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(1)
    drawn = rng.choice(np.array([0, 100, -1], dtype=np.int8), (37, 53))
    pair = map_pair(MapFile(drawn, 0.025, (-3.25, 1.5, -0.7)), tmp_path / "a.b", suffix, 65, 19.6)
    write_whole(pair)
    image, text = pair
    assert (image.name, text.name) == (f"a.b{suffix}", "a.b.yaml")
    said = yaml.safe_load(text.read_text())
    assert said["image"] == image.name
    assert said["resolution"] == 0.025
    assert said["origin"] == [-3.25, 1.5, -0.7]
    shades = np.asarray(Image.open(image))
    assert shades.tolist() == np.select([drawn == 100, drawn == 0], [0, 254], 205)[::-1].tolist()
    again = read_map(text)
    assert again.cells.tolist() == drawn.tolist()
    assert again.origin == (-3.25, 1.5, -0.7)


def test_written_by_thresholds(tmp_path: Path) -> None:
    drawn = np.array([[0, 10, 11, 50, 51, 100, -1]], dtype=np.int8)
    write_whole(map_pair(MapFile(drawn, 1.0, (0.0, 0.0, 0.0)), tmp_path / "map", ".pgm", 50, 11))
    assert read_map(tmp_path / "map.yaml").cells.tolist() == [[0, 0, -1, -1, 100, 100, -1]]


def odd_words(tmp_path: Path, pixels: Any, **changes: str) -> list[str]:
    """Return what is said of a map of these pixels."""
    Image.fromarray(pixels).save(tmp_path / "drawn.png")
    keys = {"image": "drawn.png", "resolution": "0.1", "origin": "[0, 0, 0]", "negate": "0"}
    keys |= {"occupied_thresh": "0.65", "free_thresh": "0.196", **changes}
    (tmp_path / "odd.yaml").write_text("".join(f"{key}: {value}\n" for key, value in keys.items()))
    return list(read_map(tmp_path / "odd.yaml").odd)


def test_what_was_hardly_meant_is_told(tmp_path: Path) -> None:
    drawn = np.full((20, 20), 205, dtype=np.uint8)
    drawn[3:10] = 254
    assert odd_words(tmp_path, drawn) == []
    assert odd_words(tmp_path, drawn, free_thresh="0.25", mode="scale") == []
    (words,) = odd_words(tmp_path, drawn, free_thresh="0.25")
    assert words.startswith(
        f"{tmp_path}/odd.yaml: 260 pixels of the shade 205, which map_saver writes for unknown, are free"
    )
    (words,) = odd_words(tmp_path, drawn, negate="1")
    assert "are walls by occupied_thresh 0.65 and negate" in words
    black = np.zeros((20, 20, 4), dtype=np.uint8)
    black[4:6, :, 3] = 255
    (words,) = odd_words(tmp_path, black)
    assert "360 transparent pixels of drawn.png are walls" in words
    black[..., :3] = np.where(black[..., 3:] == 0, 255, 0)
    assert odd_words(tmp_path, black) == []


def test_an_item_of_a_list_is_named_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(Error, match=r"odd\.yaml:3: origin\[2\]: must be a number, not str '-nan'"):
        odd_words(tmp_path, np.zeros((2, 2), dtype=np.uint8), origin="[0, 0, -nan]")
