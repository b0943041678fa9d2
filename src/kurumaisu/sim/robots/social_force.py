# SPDX-License-Identifier: BSD-3-Clause
"""The social force of Helbing and Molnar, Physical Review E 51 (1995) 4282: equations and values are the paper's."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray

RELAXATION = 0.5  # [s] tau, to take up the desired velocity
FASTEST = 1.3  # [-] of the desired speed
_STRENGTH, _RANGE = 2.1, 0.3  # [m^2/s^2], [m] of the repulsion by others: V0, sigma
_STRIDE = 2.0  # [s] of the other's way that is kept free: Delta t
_WALL_STRENGTH, _WALL_RANGE = 10.0, 0.2  # [m^2/s^2], [m] of the repulsion by walls: U0, R
_SIGHT = np.cos(np.deg2rad(100.0))  # half the angle of sight, 2 phi = 200 degrees
_BEHIND = 0.5  # [-] weight of what is out of sight: c
_NEAREST = 1.0e-6  # [m] nearer than this counts as so far, or forces had no direction


def drive(velocities: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return accelerations (n, 2) towards the wanted velocities (n, 2). Equation (2)."""
    return (wanted - velocities) / RELAXATION


def repulsion(places: FloatArray, wanted: FloatArray, others: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return accelerations (n, 2) of those at places (n, 2) by others (m, 2) who move with velocities (m, 2).

    Equations (3) and (4), weighted by sight: the potential decays with the small half-axis b of an ellipse about the
    other's next stride. Who is at the very same place is the walker himself.
    """
    r = places[:, None] - others[None]
    ahead = r - velocities[None] * _STRIDE
    near, far = np.linalg.norm(r, axis=2), np.linalg.norm(ahead, axis=2)
    stride = np.linalg.norm(velocities, axis=1)[None] * _STRIDE
    b = np.maximum(0.5 * np.sqrt(np.maximum((near + far) ** 2 - stride**2, 0.0)), _NEAREST)
    slope = _unit(r) + _unit(ahead)
    force = (_STRENGTH / _RANGE * np.exp(-b / _RANGE) * (near + far) / (4 * b))[:, :, None] * slope
    force[near < _NEAREST] = 0.0
    return np.asarray((_weight(wanted, -force)[:, :, None] * force).sum(axis=1))


def wall_repulsion(place: FloatArray, walls: FloatArray) -> FloatArray:
    """Return the acceleration (2,) of one at a place (2,) by the nearest point of walls (m, 4). Equation (5)."""
    if not len(walls):
        return np.zeros(2)
    a, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    square = np.maximum((along**2).sum(axis=1), _NEAREST**2)
    share = np.clip(((place - a) * along).sum(axis=1) / square, 0.0, 1.0)
    r = place - (a + share[:, None] * along)
    distances = np.linalg.norm(r, axis=1)
    nearest = int(distances.argmin())
    force = _WALL_STRENGTH / _WALL_RANGE * np.exp(-distances[nearest] / _WALL_RANGE)
    return np.asarray(force * _unit(r[nearest]))


def _weight(wanted: FloatArray, causes: FloatArray) -> FloatArray:
    """Return 1 for what is in sight of one who looks where he wants to go, else c; causes (n, m, 2) point at it."""
    along = np.einsum("nk,nmk->nm", _unit(wanted), _unit(causes))
    return np.where(along >= _SIGHT, 1.0, _BEHIND)


def _unit(vectors: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, _NEAREST))
