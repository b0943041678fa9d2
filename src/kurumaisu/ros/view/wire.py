# SPDX-License-Identifier: BSD-3-Clause
"""kurumaisu/View as the bytes that go over the wire, written in place: genpy would copy every row some times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kurumaisu.ros.view.fans import Looks

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NS = 1_000_000_000
_WORD = "<u4"  # of the lengths in front of what varies


@dataclass(frozen=True)
class Lengths:
    """How long the parts are; truths and intensities: beams, or 0 if there are none."""

    bodies: int
    robots: int
    fans: int
    beams: int
    truths: int
    intensities: int


class ViewWire:
    """A View of one shape; its rows are numpy arrays of their part of the bytes.

    data: with the word of TCPROS in front that says how many bytes follow.
    """

    def __init__(self, frame: str, shape: Lengths) -> None:
        """frame: of the header."""
        name = frame.encode()
        arrays = {
            "poses": ("<f8", 3, shape.bodies),
            "hit": ("u1", 1, shape.bodies),
            "contacts": ("<u4", 1, shape.bodies),
            "odometry": ("<f8", 3, shape.robots),
            "stamps": ("<u4", 2, shape.fans),
            "sensors": ("<f8", 3, shape.fans),
            "ranges": ("<f4", 1, shape.beams),
            "truths": ("<f4", 1, shape.truths),
            "intensities": ("<f4", 1, shape.intensities),
        }
        layout: list[Any] = [("length", _WORD), ("seq", _WORD), ("stamp", _WORD, 2)]
        layout += [("name_length", _WORD), ("name", "u1", len(name)), ("world", _WORD), ("run", _WORD)]
        layout += [("paused", "u1"), ("speed", "<f4"), ("real_time_factor", "<f4")]
        counts = {}
        for field, (kind, width, count) in arrays.items():
            # an array of times or numbers counts these, but a pose is three numbers
            counts[field] = count if field == "stamps" else width * count
            layout += [(f"{field}_length", _WORD), (field, kind, (count, width) if width > 1 else (count,))]
        record = np.dtype(layout)  # packed: without gaps, as the wire has it
        self.data = bytearray(record.itemsize)
        self._record: NDArray[Any] = np.frombuffer(self.data, record, 1)
        self._set("length", record.itemsize - np.dtype(_WORD).itemsize)
        self._set("name_length", len(name))
        self._set("name", np.frombuffer(name, np.uint8))
        for field, number in counts.items():
            self._set(f"{field}_length", number)
        self.poses, self.hit, self.contacts = map(self._row, ("poses", "hit", "contacts"))
        self.odometry = self._row("odometry")
        self.stamps, self.sensors = self._row("stamps"), self._row("sensors")
        self.ranges, self.truths, self.intensities = map(self._row, ("ranges", "truths", "intensities"))

    def head(self, seq: int, stamp: tuple[int, int], world: int, run: int) -> None:
        """Set the header's number and time, and which world and run this is of."""
        self._set("seq", seq & 0xFFFFFFFF)
        self._set("stamp", stamp)
        self._set("world", world)
        self._set("run", run)

    def pace(self, paused: bool, speed: float, real_time_factor: float) -> None:
        """Set how fast it runs."""
        self._set("paused", paused)
        self._set("speed", speed)
        self._set("real_time_factor", real_time_factor)

    def fill(self, looks: Looks) -> None:
        """Set the scans."""
        self.stamps[:, 0], self.stamps[:, 1] = np.divmod(looks.stamps, _NS)
        self.sensors[:] = looks.poses
        self.ranges[:] = looks.ranges
        self.intensities[:] = looks.intensities
        if looks.truths is not None:
            self.truths[:] = looks.truths

    def _set(self, field: str, value: Any) -> None:
        self._record[field][0] = value

    def _row(self, field: str) -> NDArray[Any]:
        row: NDArray[Any] = self._record[field][0]
        return row
