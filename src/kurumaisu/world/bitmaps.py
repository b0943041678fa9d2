# SPDX-License-Identifier: BSD-3-Clause
"""Images as walls: which pixels are occupied, and their outline as long straight runs."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kurumaisu.bounded_files import MOST_IMAGE, MOST_TEXT, check_file, read_text
from kurumaisu.errors import Error, one_line, told
from kurumaisu.settings import parsed
from kurumaisu.types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL import Image

Pixels = np.ndarray[Any, np.dtype[Any]]  # (height, width), row 0 at the top, of whatever type the image has

_MOST_PIXELS = 10**8  # of an image: 100 MB
_MOST_RUNS = 5_000_000  # of an outline: 160 MB; a map of a building has some thousand
_DARKEST_FREE = 128  # first channel of a pixel that is not a wall, as in libstage/stage.cc


@dataclass(frozen=True)
class Bitmap:
    """The walls of an image.

    runs: (m, 4), x and y of both ends in pixels from the image's lower left corner, y up; width, height [pixels];
    resolution: edge of a pixel [m], and origin: x, y [m] and heading [rad] of the lower left corner, if known.
    """

    path: Path
    runs: FloatArray
    width: int
    height: int
    resolution: float | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height [m] of an image whose resolution is known."""
        edge = self.resolution or 1.0
        return self.width * edge, self.height * edge


def read_bitmap(path: Path) -> Bitmap:
    """Read an image as Stage does, or a map of ROS' map_server if the name ends in .yaml. Raise Error naming it."""
    if is_map(path):
        return _read_map(path)
    return _bitmap(path, np.asarray(_pixels(path, every_channel=False) < _DARKEST_FREE))


def is_map(path: Path) -> bool:
    """Return whether a file's name is that of a map of ROS' map_server."""
    return path.suffix.lower() in (".yaml", ".yml")


def outline(occupied: BoolArray) -> FloatArray:
    """Return the borders (m, 4) between wall and free pixels, straight runs joined; row 0 at the bottom.

    As in Stage, the wall is to the right of each.
    """
    pixels = np.pad(occupied.view(np.int8), 1)
    y, x0, x1 = _runs(-np.diff(pixels, axis=0))
    x, y0, y1 = _runs(np.diff(pixels, axis=1).T)
    flat, upright = np.array([x0, y, x1, y]), np.array([x, y0, x, y1])
    return np.ascontiguousarray(np.hstack([flat, upright]).T, dtype=np.float64)


def _runs(step: NDArray[np.int8]) -> tuple[IntArray, IntArray, IntArray]:
    """Return row, first and last column of runs of one non-zero value in an array whose outer columns are 0.

    A run of -1 is from its last column to its first.
    """
    changes = step[:, 1:] != step[:, :-1]
    if step.flags.c_contiguous:
        row, column = np.divmod(np.flatnonzero(changes), changes.shape[1])
    else:
        column, row = np.divmod(np.flatnonzero(changes.T), changes.shape[0])
        order = np.lexsort((column, row))
        row, column = row[order], column[order]
    sense = step[row, column + 1]
    starts = np.flatnonzero(sense)  # a change to nothing ends a run and begins none
    ahead, one, other = sense[starts] > 0, column[starts], column[starts + 1]
    return row[starts], np.where(ahead, one, other), np.where(ahead, other, one)


def _bitmap(path: Path, occupied: BoolArray) -> Bitmap:
    borders = sum(int(np.count_nonzero(np.diff(occupied, axis=axis))) for axis in (0, 1))
    if borders > _MOST_RUNS:
        raise Error(f"{path}: has {borders} borders between wall and free pixels, more than {_MOST_RUNS}: not a map")
    return Bitmap(path, outline(occupied[::-1]), occupied.shape[1], occupied.shape[0])


def _pixels(path: Path, every_channel: bool) -> Pixels:
    """Return the first channel, or the mean of the colours, of all pixels (height, width), row 0 at the top."""
    from PIL import Image  # worlds without bitmaps need not pay for it

    check_file(path, MOST_IMAGE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of large images, for which there is our own limit, and of damaged ones
            with Image.open(path) as image:
                if image.width * image.height > _MOST_PIXELS:
                    raise Error(f"{path}: has {image.width} x {image.height} pixels, more than {_MOST_PIXELS}")
                pixels: Pixels = _channel(image, every_channel)
                return pixels
    except Error:
        raise
    except Exception as error:  # decoders of foreign files raise whatever they come across
        raise Error(f"{path}: is not a readable image ({error})") from error


def _channel(image: Image.Image, every_channel: bool) -> Pixels:
    if image.mode in ("P", "PA", "CMYK", "YCbCr", "LAB", "HSV"):
        image = image.convert("RGB")
    if image.mode.startswith("I"):  # 16 bits; Stage takes the upper 8
        return np.asarray(np.asarray(image) >> 8)
    colours = [band for band in image.getbands() if band != "A"]
    if every_channel and len(colours) > 1:
        return np.asarray(np.mean([np.asarray(image.getchannel(band)) for band in colours], axis=0))
    if image.mode == "1":
        return np.asarray(image.convert("L"))
    return np.asarray(image if len(image.getbands()) == 1 else image.getchannel(0))


def _read_map(path: Path) -> Bitmap:
    """Read a map of map_server: occupied is what is darker than occupied_thresh says (map_server/image_loader)."""
    said = _read_yaml(path)
    shades = _pixels(path.parent / said.image, every_channel=True)
    probability = shades / 255.0 if said.negate else (255.0 - shades) / 255.0
    found = _bitmap(path, np.asarray(probability > said.occupied_thresh))
    return Bitmap(path, found.runs, found.width, found.height, said.resolution, said.origin)


@dataclass(frozen=True)
class _Map:
    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float


def _read_yaml(path: Path) -> _Map:
    try:
        keys = parsed(read_text(path, MOST_TEXT), str(path))
    except Error as error:
        raise Error(f"{path}: is not a readable map: {one_line(error)}") from error
    if not isinstance(keys, dict) or not isinstance(keys.get("image"), str):
        raise Error(f"{path}: is not a map of map_server: it names no image")
    if keys.get("mode", "trinary") == "raw":
        raise Error(f"{path}: mode raw is not supported, only trinary and scale")
    origin = keys.get("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise Error(f"{path}: origin must be [x, y, yaw], not {told(origin)}")
    resolution = _finite(path, "resolution", keys.get("resolution"))
    if resolution <= 0:
        raise Error(f"{path}: resolution must be above 0, not {resolution:g}")
    x, y, yaw = (_finite(path, "origin", value) for value in origin)
    return _Map(
        image=keys["image"],
        resolution=resolution,
        origin=(x, y, yaw),
        negate=bool(_finite(path, "negate", keys.get("negate"))),
        occupied_thresh=_finite(path, "occupied_thresh", keys.get("occupied_thresh")),
    )


def _finite(path: Path, key: str, value: object) -> float:
    """Return a number of a map's keys; YAML takes 1e-3 for a string, map_server does not."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise Error(f"{path}: {key} must be a number, not {told(value)}")
    return number
