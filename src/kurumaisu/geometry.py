# SPDX-License-Identifier: BSD-3-Clause
"""Poses in the plane: arrays (..., 3) of x [m], y [m], theta [rad]; and, with z, (..., 4) of x, y, z, heading."""

import numpy as np

from kurumaisu.types import FloatArray

PLANAR = [0, 1, 3]  # of a pose (..., 4)


def wrap(angle: FloatArray | float) -> FloatArray:
    """Return angles [rad] in (-pi, pi]; those that are there already stay as they are, to the last bit."""
    angle = np.asarray(angle, dtype=np.float64)
    return np.asarray(angle - 2 * np.pi * np.ceil(angle / (2 * np.pi) - 0.5))


def cos_sin(angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cosines and sines of angles [rad], the same to the last bit wherever they lie in memory.

    For strided arguments numpy chooses between two implementations by addresses, and their last bits differ.
    """
    together = np.array(angles, order="C")
    return np.cos(together), np.sin(together)


def compose(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return map_from_b = map_from_a * a_from_b for poses (..., 3)."""
    c, s = cos_sin(a[..., 2])
    return np.stack(
        [
            a[..., 0] + c * b[..., 0] - s * b[..., 1],
            a[..., 1] + s * b[..., 0] + c * b[..., 1],
            a[..., 2] + b[..., 2],
        ],
        axis=-1,
    )


def between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a_from_b for poses a, b (..., 3) in the same frame; the angle is not wrapped."""
    c, s = cos_sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    return np.stack([c * dx + s * dy, -s * dx + c * dy, b[..., 2] - a[..., 2]], axis=-1)


def relative(frame: FloatArray, pose: FloatArray) -> FloatArray:
    """Return a pose (..., 4) of the map as seen in a frame (..., 4) of the map."""
    c, s = cos_sin(frame[..., 3])
    d = pose - frame
    return np.stack([c * d[..., 0] + s * d[..., 1], c * d[..., 1] - s * d[..., 0], d[..., 2], d[..., 3]], axis=-1)


def attached(frame: FloatArray, pose: FloatArray) -> FloatArray:
    """Return in the map what is a pose (..., 4) in a frame (..., 4); the heading is not wrapped."""
    c, s = cos_sin(frame[..., 3])
    x, y = pose[..., 0], pose[..., 1]
    return np.stack(
        [
            frame[..., 0] + c * x - s * y,
            frame[..., 1] + s * x + c * y,
            frame[..., 2] + pose[..., 2],
            frame[..., 3] + pose[..., 3],
        ],
        axis=-1,
    )


def interpolate(times: FloatArray, poses: FloatArray, at: FloatArray) -> FloatArray:
    """Return poses (m, 3) at times `at` (m,), linear between samples (n, 3) whose theta is unwrapped."""
    return np.stack([np.interp(at, times, poses[:, i]) for i in range(3)], axis=-1)
