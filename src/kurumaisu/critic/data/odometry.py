# SPDX-License-Identifier: BSD-3-Clause
"""What odometry says where it was left unsaid: rates out of poses, and poses out of wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import geometry
from kurumaisu.types import FloatArray

COLUMNS = ("x", "y", "theta", "v", "w")


@dataclass(frozen=True)
class Wheels:
    """Wheels driven apart from each other. radius, track [m]; left, right: joints of `topic`, or topics of numbers."""

    left: tuple[str, ...]
    right: tuple[str, ...]
    radius: float
    track: float
    topic: str = ""

    def motion(self, wheels: FloatArray) -> FloatArray:
        """Return way and turn, (n, 2), of angles of the left and the right wheel, (n, 2), or the rates of rates."""
        left, right = self.radius * wheels.T
        return np.stack([(left + right) / 2, (right - left) / self.track], axis=1)


def rates_between(t: FloatArray, poses: FloatArray) -> FloatArray:
    """Return v [m/s] and w [rad/s], (n, 2), of the arcs between poses (n, 3) at times (n,) [s].

    The rates of a row are those of the interval that ends there; the first row's are those of the second.
    """
    if len(t) < 2:
        return np.zeros((len(t), 2))
    step = geometry.between(poses[:-1], poses[1:])
    turn = geometry.wrap(step[:, 2])
    # Equation (3) in closed form: an arc is longer than its chord, which points half the turn aside.
    chord = step[:, 0] * np.cos(turn / 2) + step[:, 1] * np.sin(turn / 2)
    arc = chord / np.sinc(turn / (2 * np.pi))
    dt = np.diff(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.column_stack([arc, turn]) / dt[:, None]
    return np.vstack([rates[:1], rates])


def driven_by(t: FloatArray, rates: FloatArray) -> FloatArray:
    """Return poses (n, 3), the first 0, of rates v [m/s] and w [rad/s], (n, 2), that change evenly between rows."""
    return along((rates[1:] + rates[:-1]) / 2 * np.diff(t)[:, None])


def along(arcs: FloatArray) -> FloatArray:
    """Return the poses (n + 1, 3), the first 0, at the ends of arcs (n, 2) of a length [m] and a turn [rad]."""
    theta = np.append(0.0, np.cumsum(arcs[:, 1]))
    # The chord of an arc points half the turn aside, and is shorter than the arc.
    course, chord = (theta[1:] + theta[:-1]) / 2, arcs[:, 0] * np.sinc(arcs[:, 1] / (2 * np.pi))
    x, y = (np.append(0.0, np.cumsum(chord * f(course))) for f in (np.cos, np.sin))
    return np.stack([x, y, theta], axis=1)
