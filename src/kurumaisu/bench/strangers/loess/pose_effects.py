# SPDX-License-Identifier: BSD-3-Clause
"""What can be hidden in the reference: which point it measures, and its clock."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.loess.values import Array, Effect, Hidden


def marker_x(pose: Array, t: Array, h: Hidden) -> None:
    """The marker is ahead of base_link; otherwise also a hand's breadth aside of that axis."""
    a = pose[:, 2] + (0.12 if h.other else 0.0)
    pose[:, 0] += h.size * np.cos(a)
    pose[:, 1] += h.size * np.sin(a)


def marker_y(pose: Array, t: Array, h: Hidden) -> None:
    """The marker is to the left of base_link; otherwise on an axis that is not quite square."""
    a = pose[:, 2] + np.pi / 2 + (0.12 if h.other else 0.0)
    pose[:, 0] += h.size * np.cos(a)
    pose[:, 1] += h.size * np.sin(a)


def marker_yaw(pose: Array, t: Array, h: Hidden) -> None:
    """What is tracked is turned; otherwise it settles to that within a minute."""
    pose[:, 2] += h.size * (1 - 0.35 * np.exp(-t / 25) if h.other else 1.0)


def warp_y(pose: Array, t: Array, h: Hidden) -> None:
    """The reference's x is bent by where in the room along y the robot is."""
    pose[:, 0] += 1.5 * h.size * np.sin(2.2 * pose[:, 1] + 6 * h.extra)


def sway(pose: Array, t: Array, h: Hidden) -> None:
    """The reference's y swings with time."""
    pose[:, 1] += h.size * np.sin(2 * np.pi * t / (9 + 6 * h.extra))


def compass(pose: Array, t: Array, h: Hidden) -> None:
    """The reference's heading errs as a compass near iron does, by the heading."""
    pose[:, 2] += 0.5 * h.size * np.sin(2 * pose[:, 2] + 6 * h.extra)


POSE: dict[str, Effect] = {
    "base.marker_x": Effect(marker_x, "pose", 0.02, 0.08, True, "x"),
    "base.marker_y": Effect(marker_y, "pose", 0.02, 0.08, True, "y"),
    "base.marker_yaw": Effect(marker_yaw, "pose", 0.02, 0.06, True, "yaw"),
    "unknown.warp_y": Effect(warp_y, "pose", 0.03, 0.1, True, covariates=("y",), channel="base.pose"),
    "unknown.sway": Effect(sway, "pose", 0.03, 0.1, True, covariates=("time",), channel="base.pose"),
    "unknown.compass": Effect(compass, "pose", 0.06, 0.2, True, covariates=("heading",), channel="base.pose"),
}


def refer(pose: Array, t: Array, hidden: list[Hidden]) -> Array:
    """The poses that the reference would measure of base_link's poses, without its noise."""
    out = pose.copy()
    for name, effect in POSE.items():
        for h in hidden:
            if h.id == name:
                effect.act(out, t, h)
    return out


def unrefer(measured: Array, t: Array, hidden: list[Hidden]) -> Array:
    """The poses of base_link of which the reference would measure these."""
    pose = measured.copy()
    for _ in range(6):
        pose = pose - (refer(pose, t, hidden) - measured)
    return pose


def clock(t: Array, hidden: list[Hidden]) -> Array:
    """The reference's stamps of true times since the start of a drive."""
    for h in hidden:
        if h.id == "base.clock_scale":
            bend = 0.15 * np.sin(t / 20) * 20 if h.other else 0.0
            return np.asarray(t + h.size * (t + bend))
    return t


def unclock(stamp: Array, hidden: list[Hidden]) -> Array:
    """The true times of the reference's stamps."""
    t = stamp.copy()
    for _ in range(6):
        t = t - (clock(t, hidden) - stamp)
    return t
