# SPDX-License-Identifier: BSD-3-Clause
"""What tests of `view RECORDING` look at: made-up drives in a room, and what a page would be told of them."""

import json

import numpy as np
from recordings import series
from viewer_rig import viewer_settings

from kurumaisu.critic.values.recording import Run
from kurumaisu.critic.view.command import opened

ROOM = """\
name "room"
define wall model ( size [6.2 0.1 1.0] )
wall ( pose [3.0 -0.05 0 0] )
wall ( pose [3.0 5.05 0 0] )
wall ( pose [-0.05 2.5 0 90] size [5.2 0.1 1.0] )
wall ( pose [6.05 2.5 0 90] size [5.2 0.1 1.0] )
"""
LASER = {"x": 0.3, "y": 0.1, "yaw": 0.2, "angle_min": -1.5, "angle_increment": 0.5, "beams": 7}


class Look:
    """A recording that is open, and what a page would be told."""

    def __init__(self, path, folder=None, wanted=()):
        self.opened = opened(path, wanted, None, folder, viewer_settings())
        self.source = self.opened.source

    def __enter__(self):
        self.opened.__enter__()
        self.mailbox = self.source._hub.join(lambda: None)
        self.told = {}
        self._hear()
        return self

    def __exit__(self, *_):
        self.opened.__exit__()

    def _hear(self):
        for payload in self.mailbox.take():
            if isinstance(payload, bytes):
                self.scan = payload
            else:
                message = json.loads(payload)
                self.told[message["type"]] = message

    def at(self, t, run=None):
        if run is not None:
            self.source.command("run", {"run": run})
        self.source.command("seek", {"t": t})
        self._hear()
        return self.told["state"]

    @property
    def notes(self):
        return " | ".join(note["text"] for note in self.told["state"]["notes"])

    def ranges(self):
        """Return ranges and errors (None where there are none) of the scan that is shown, and where the laser is."""
        flags, count = self.scan[1], int.from_bytes(self.scan[2:4], "little")
        values = np.frombuffer(self.scan, np.float32, offset=8)
        return values[7 : 7 + count], values[7 + count : 7 + 2 * count] if flags & 1 else None, values[:3]

    def intensities(self):
        """Return those of the scan that is shown, None where it has none."""
        count = int.from_bytes(self.scan[2:4], "little")
        return np.frombuffer(self.scan, np.float32, offset=8)[-count:] if self.scan[1] & 2 else None


def stamp_of(message):
    stamp = message.header.stamp
    return (stamp.sec * 10**9 + stamp.nanosec) / 1e9


def meta(folder, **content):
    (folder / "meta.yaml").write_text(json.dumps(content))  # JSON is YAML


def on_circle(t):
    theta = 0.25 * t
    return 2.0 + 1.2 * np.sin(theta), 1.3 + 1.2 * (1 - np.cos(theta)), theta


def drive(name, start, seconds=30.0):
    """A chair that circles as it is asked to."""
    t = start + np.arange(0, seconds, 0.1)
    v, w = np.full(len(t), 0.3), np.full(len(t), 0.25)
    x, y, theta = on_circle(t - start)
    turned = np.column_stack([x - 1.0, y + 2.0, theta])
    ranges = np.array([room_ranges(pose) for pose in np.column_stack([x, y, theta])]) + 0.02
    return Run(
        name,
        command=series(t, "vw", v, w),
        pose=series(t, ("x", "y", "theta"), x, y, theta),
        odom=series(t, ("x", "y", "theta", "v", "w"), *turned.T, v, w),
        scan=series(t, [f"r{i}" for i in range(7)], ranges),
    )


def room_ranges(pose):
    """Return the ranges in a room of 6 x 5 m, by the planes that each beam meets."""
    x, y, theta = pose
    x, y = x + 0.3 * np.cos(theta) - 0.1 * np.sin(theta), y + 0.3 * np.sin(theta) + 0.1 * np.cos(theta)
    along = theta + 0.2 - 1.5 + 0.5 * np.arange(7)
    c, s = np.cos(along), np.sin(along)
    with np.errstate(divide="ignore"):
        return np.minimum(np.where(c > 0, 6 - x, -x) / c, np.where(s > 0, 5 - y, -y) / s)
