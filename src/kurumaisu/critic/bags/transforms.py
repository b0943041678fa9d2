# SPDX-License-Identifier: BSD-3-Clause
"""Poses of one frame in another, out of the transforms of a bag."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kurumaisu.critic.bags.topics import read_messages, stamp_of
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.types import FloatArray

TOPICS = ("/tf", "/tf_static")
_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


@dataclass
class Edge:
    """Transforms of a frame in another: stamps (n,) [ns], rows (n, 7) of translation [m] and quaternion x, y, z, w."""

    fixed: bool = True
    stamps: array[int] = field(default_factory=lambda: array("q"))
    numbers: array[float] = field(default_factory=lambda: array("d"))

    def at(self, times: FloatArray) -> FloatArray:
        """Return the transforms at times (m,) [s], (m, 4, 4), between stamps as tf has them."""
        rows = np.asarray(self.numbers).reshape(-1, 7)
        if self.fixed:
            return _matrices(np.repeat(rows[-1:], len(times), axis=0))
        stamps, first = np.unique(np.asarray(self.stamps) / 1e9, return_index=True)
        rows = rows[first]
        turns = rows[:, 3:]  # of the two quaternions of a rotation, the one nearer to that before
        flips = np.cumprod(np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0, -1.0, 1.0))
        turns[1:] *= flips[:, None]
        return _matrices(np.stack([np.interp(times, stamps, column) for column in rows.T], axis=1))


def read_frame(path: Path, parent: str, child: str) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) [s] and poses (n, 3) of x, y [m], theta [rad] of a frame in another.

    They are those of the stamps of the transform of the chain that has most, where all are known.
    Raise Error naming the file, and the frames that there are, where no chain leads from one to the other.
    """
    chain = _chain(path, parent, child)
    edges = {pair: Edge() for pair in chain}
    for pair, stamp, row, fixed in _transforms(path):
        if pair in edges:
            edges[pair].fixed &= fixed
            edges[pair].stamps.append(stamp)
            edges[pair].numbers.extend(row)
    moving = [edge for edge in edges.values() if not edge.fixed]
    if not moving:
        raise Error(f"{path}: tf: nothing moves between {parent} and {child}: all their transforms are static")
    times = np.unique(np.asarray(max(moving, key=lambda edge: len(edge.stamps)).stamps)) / 1e9
    known = [(min(edge.stamps) / 1e9, max(edge.stamps) / 1e9) for edge in moving]
    times = times[(times >= max(start for start, _ in known)) & (times <= min(end for _, end in known))]
    total = np.repeat(np.eye(4)[None], len(times), axis=0)
    for pair in chain:
        total = total @ edges[pair].at(times)
    return times, np.stack([total[:, 0, 3], total[:, 1, 3], np.arctan2(total[:, 1, 0], total[:, 0, 0])], axis=1)


def _chain(path: Path, parent: str, child: str) -> list[tuple[str, str]]:
    """Return the pairs of frames that lead from the parent down to the child."""
    above: dict[str, str] = {}
    for (upper, lower), *_ in _transforms(path):
        above.setdefault(lower, upper)
        chain: list[tuple[str, str]] = []
        frame = child
        while frame != parent and frame in above and len(chain) <= len(above):
            chain.append((above[frame], frame))
            frame = above[frame]
        if frame == parent and chain:
            return chain[::-1]
    if not above:
        raise Error(f"{path}: tf: there is no transform on {' or '.join(TOPICS)}")
    frames = sorted({*above, *above.values()})
    for frame in (parent, child):
        if frame not in frames:
            raise Error(f"{path}: tf: there is no frame {frame!r}; {hint(frame, frames)}")
    pairs = ", ".join(f"{lower} in {upper}" for lower, upper in list(above.items())[:20])
    raise Error(f"{path}: tf: no chain of transforms leads from {parent} down to {child}; there are: {pairs}")


def _transforms(path: Path) -> Iterator[tuple[tuple[str, str], int, tuple[float, ...], bool]]:
    """Yield frames, stamp [ns], translation and quaternion, and whether it is static, of all transforms of a bag."""
    for bag, connection, _, message in read_messages(path, TOPICS):
        if connection.msgtype not in _TYPES:
            raise Error(f"{bag}: {connection.topic}: is of type {connection.msgtype}, which has no transforms")
        for item in message.transforms:
            frames = item.header.frame_id.lstrip("/"), item.child_frame_id.lstrip("/")
            place, turn = item.transform.translation, item.transform.rotation
            row = place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w
            yield frames, stamp_of(item), row, connection.topic.endswith("static")


def _matrices(rows: FloatArray) -> FloatArray:
    """Return transforms (n, 4, 4) of rows (n, 7); a quaternion may have any length but 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y, z, w = (rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)).T
    found = np.zeros((len(rows), 4, 4))
    found[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    found[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    found[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    found[:, :3, 3] = rows[:, :3]
    found[:, 3, 3] = 1.0
    return found
