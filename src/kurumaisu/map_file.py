# SPDX-License-Identifier: BSD-3-Clause
"""Maps of map_server read as map_server reads them: a YAML file and the image that it names."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from kurumaisu import settings
from kurumaisu.bounded_files import MOST_IMAGE, MOST_TEXT, check_file, read_text
from kurumaisu.errors import Error, told
from kurumaisu.plausible import require
from kurumaisu.settings import Section
from kurumaisu.types import FloatArray

_MOST_CELLS = 10**8  # some 600 MB while it is read
_MODES = ("trinary", "scale", "raw")
_WALL = 100  # occupancy [%]
_OPAQUE = 255
_MANY = 0.01  # share of an image's pixels
_SHADE_WALL, _SHADE_FREE, _SHADE_UNKNOWN = 0, 254, 205  # map_saver's
OCCUPIED_ABOVE, FREE_BELOW = 65, 19.6  # [%] what map_saver's files say


@dataclass(frozen=True)
class MapFile:
    """Occupancy: cells (height, width) from the lower left corner, 0 free to 100 occupied, -1 unknown.

    resolution: edge of a cell [m]; origin: x, y [m] and yaw [rad] of the lower left corner; odd: what in its files is
    likely not what was meant, in words.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float]
    odd: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Said:
    image: Path
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied: float
    free: float
    mode: str


def read_map(path: Path) -> MapFile:
    """Read a map. Raise Error naming the file, and the key, that is wrong."""
    said = _read_yaml(path)
    cells, odd = _cells(said)
    words = tuple(f"{path}: {each}" for each in odd)
    return MapFile(np.ascontiguousarray(cells[::-1]), said.resolution, said.origin, words)


def map_pair(written: MapFile, path: Path, suffix: str, occupied: float, free: float) -> dict[Path, str | bytes]:
    """Return the image (.pgm or .png) and path.yaml, in this order, to be written; path has no suffix.

    Cells above occupied [%] are drawn as walls, those below free [%] as free, all others as unknown.
    """
    shades = np.full(written.cells.shape, _SHADE_UNKNOWN, dtype=np.uint8)
    shades[written.cells > occupied] = _SHADE_WALL
    shades[(written.cells >= 0) & (written.cells < free)] = _SHADE_FREE
    image, text = path.with_name(path.name + suffix), path.with_name(path.name + ".yaml")
    x, y, yaw = written.origin
    turn = np.format_float_positional(yaw, precision=9, trim="0")  # YAML takes 1e-9 for a string
    drawn = BytesIO()
    Image.fromarray(np.ascontiguousarray(shades[::-1])).save(drawn, {".pgm": "PPM", ".png": "PNG"}[suffix])
    said = (
        f"image: {image.name}\nresolution: {written.resolution:.6f}\n"
        f"origin: [{x:.6f}, {y:.6f}, {turn}]\nnegate: 0\n"
        f"occupied_thresh: {OCCUPIED_ABOVE / 100}\nfree_thresh: {FREE_BELOW / 100}\n"
    )
    return {image: drawn.getvalue(), text: said}


def _read_yaml(path: Path) -> _Said:
    try:
        return _said(path, settings.load(path))
    except Error as error:
        raise Error(_with_line(path, str(error))) from error


def _with_line(path: Path, message: str) -> str:
    """Return a message of settings.Section with the line of the key that it names, if it names one that is there."""
    match = re.match(re.escape(f"{path}: ") + r"(\w+)[\w.\[\]]*: ", message)
    if match is None:
        return message
    document = yaml.compose(read_text(path, MOST_TEXT))
    pairs = document.value if isinstance(document, yaml.MappingNode) else []
    lines = [key.start_mark.line + 1 for key, _ in pairs if key.value == match.group(1)]
    return f"{path}:{lines[-1]}:{message[len(str(path)) + 1 :]}" if lines else message


def _said(path: Path, top: Section) -> _Said:
    said = _Said(
        image=path.parent / top.text("image"),
        resolution=_within(top, "resolution", "resolution", top.number("resolution", above=0)),
        origin=_origin(top),
        negate=_negate(top),
        occupied=top.number("occupied_thresh"),
        free=top.number("free_thresh"),
        mode=top.text("mode", _MODES) if "mode" in top else "trinary",
    )
    top.end()
    for key, value in (("occupied_thresh", said.occupied), ("free_thresh", said.free)):
        if not 0 <= value <= 1:
            raise top.error(key, f"must be from 0 to 1: {value:g}")
    if said.free >= said.occupied:
        raise top.error("free_thresh", f"must be below occupied_thresh {said.occupied:g}: {said.free:g}")
    return said


def _origin(top: Section) -> tuple[float, float, float]:
    x, y, yaw = top.numbers("origin", 3)
    _within(top, "position", "origin[0]", x)
    _within(top, "position", "origin[1]", y)
    _within(top, "angle", "origin[2]", yaw)
    return x, y, yaw


def _within(top: Section, quantity: str, key: str, value: float) -> float:
    try:
        return require(quantity, key, value)
    except Error as error:
        raise top.error(key, str(error).removeprefix(f"{key}: ")) from error


def _negate(top: Section) -> bool:
    value = top.take("negate")
    if value not in (0, 1):  # False and True are, too
        raise top.error("negate", f"must be 0 or 1: {told(value)}")
    return bool(value)


def _cells(said: _Said) -> tuple[NDArray[np.int8], list[str]]:
    """Return the image's cells, row 0 at the top, and what is odd about them, in words."""
    sums, channels, opaque = _pixels(said.image)
    table = _occupancies(said, np.arange(255 * channels + 1) / channels)
    cells: NDArray[np.int8] = table[sums]
    if opaque is not None and said.mode != "raw":
        # What shines through is not known, but for walls and free space in plain sight.
        cells[~opaque & (cells > 0) & (cells < _WALL)] = -1
    odd = [_unknown_made_known(said, table, sums == _SHADE_UNKNOWN * channels, channels)]
    if opaque is not None:
        odd.append(_transparent_walls(said, ~opaque & (cells == _WALL)))
    return cells, [words for words in odd if words]


def _unknown_made_known(said: _Said, table: NDArray[np.int8], unknown: NDArray[np.bool_], channels: int) -> str:
    """Return words for many pixels of map_saver's shade for unknown that are something else here, or none."""
    meant = int(table[_SHADE_UNKNOWN * channels])
    if said.mode != "trinary" or meant == -1 or unknown.mean() < _MANY:
        return ""
    became, key = ("free", "free_thresh") if meant == 0 else ("walls", "occupied_thresh")
    given = f"{key} {said.free if meant == 0 else said.occupied:g}" + (" and negate" if said.negate else "")
    count, usual = int(unknown.sum()), f"{OCCUPIED_ABOVE / 100} and {FREE_BELOW / 100}"
    return (
        f"{count} pixels of the shade {_SHADE_UNKNOWN}, which map_saver writes for unknown, are {became} by {given}; "
        f"map_saver's own thresholds are {usual}"
    )


def _transparent_walls(said: _Said, walls: NDArray[np.bool_]) -> str:
    """Return words for pixels that nobody sees and that are walls, or none."""
    if not walls.any():
        return ""
    count = int(walls.sum())
    return f"{count} transparent pixels of {said.image.name} are walls: their colour counts, whatever their alpha"


def _occupancies(said: _Said, shades: FloatArray) -> NDArray[np.int8]:
    """Return the occupancy of every shade (0 black to 255 white), after map_server's image_loader."""
    if said.negate:
        shades = 255 - shades
    if said.mode == "raw":
        return np.where(shades <= _WALL, np.floor(shades), -1).astype(np.int8)
    occupied = (255 - shades) / 255
    between = 1 + 98 * (occupied - said.free) / (said.occupied - said.free)
    middle = np.floor(between) if said.mode == "scale" else np.full(len(shades), -1.0)
    cells = np.where(occupied > said.occupied, _WALL, np.where(occupied < said.free, 0, middle))
    return cells.astype(np.int8)


def _pixels(path: Path) -> tuple[NDArray[np.uint16], int, NDArray[np.bool_] | None]:
    """Return the sum of the colours of every pixel, how many colours there are, and where the image is opaque."""
    check_file(path, MOST_IMAGE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of large images, for which there is our own limit, and of damaged ones
            with Image.open(path) as image:
                if image.width * image.height > _MOST_CELLS:
                    raise Error(f"{path}: has {image.width} x {image.height} pixels, more than {_MOST_CELLS}")
                return _channels(image)
    except Error:
        raise
    except OSError as error:
        raise Error(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # decoders of foreign files raise whatever they come across
        raise Error(f"{path}: is not a readable image ({error})") from error


def _channels(image: Image.Image) -> tuple[NDArray[np.uint16], int, NDArray[np.bool_] | None]:
    if image.mode.startswith("I"):  # 16 bits; map_server sees the upper 8
        return (np.asarray(image).astype(np.uint32) >> 8).astype(np.uint16), 1, None
    if image.mode == "1":
        image = image.convert("L")
    elif image.mode not in ("L", "LA", "RGB", "RGBA"):
        image = image.convert("RGBA" if "transparency" in image.info or image.mode == "PA" else "RGB")
    names = [name for name in image.getbands() if name != "A"]
    opaque = np.asarray(image.getchannel("A")) == _OPAQUE if "A" in image.getbands() else None
    sums = np.asarray(image.getchannel(names[0])).astype(np.uint16)
    for name in names[1:]:
        sums += np.asarray(image.getchannel(name))
    return sums, len(names), opaque
