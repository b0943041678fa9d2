# SPDX-License-Identifier: BSD-3-Clause
"""The MD-100 as published: its voltages (1), (2), its laser (4), and its motion (3)."""

import numpy as np

from kurumaisu.bench.strangers.delta.core import DT, Array, Path

FORWARD, BACKWARD = (1.32402, 0.127906), (2.07369, -0.108783)
LEFT, RIGHT = (-0.499211, 0.104181), (-0.469278, -0.169476)
HEIGHT, RESOLUTION, NEAR, FAR = 0.40, 0.001, 0.06, 4.0


def volts(v: Array, w: Array) -> tuple[Array, Array]:
    """Voltages of rates, by the published law."""
    vf = np.where(v > 0, FORWARD[0] * v + FORWARD[1], BACKWARD[0] * v + BACKWARD[1])
    vs = np.where(w > 0, LEFT[0] * w + LEFT[1], RIGHT[0] * w + RIGHT[1])
    return np.where(v == 0, 0.0, vf), np.where(w == 0, 0.0, vs)


def speed(vf: Array) -> Array:
    """Forward speed that answers to a voltage."""
    ahead, back = (vf - FORWARD[1]) / FORWARD[0], (vf - BACKWARD[1]) / BACKWARD[0]
    return np.where(vf > FORWARD[1], ahead, np.where(vf < BACKWARD[1], back, 0.0))


def yaw_rate(vs: Array, meant: Array, driving: Array) -> Array:
    """Yaw rate that answers to a voltage, on the branch that was meant; no stiction about 0 V while driving."""
    left, right = np.maximum((vs - LEFT[1]) / LEFT[0], 0.0), np.minimum((vs - RIGHT[1]) / RIGHT[0], 0.0)
    straight = np.where(driving, 2 * vs / (LEFT[0] + RIGHT[0]), 0.0)
    return np.where(meant > 0, left, np.where(meant < 0, right, straight))


def corrected_yaw_rate(vs: Array) -> Array:
    """Yaw rate of a chair whose intercepts are the other way round: an ordinary dead zone."""
    left, right = np.maximum((vs + LEFT[1]) / LEFT[0], 0.0), np.minimum((vs + RIGHT[1]) / RIGHT[0], 0.0)
    return np.asarray(left + right)


def mean_reading(r: Array) -> Array:
    """Mean reading of a true range."""
    return 1.004587 * r + 0.058826


def sd_reading(r: Array) -> Array:
    """Standard deviation of a reading of a true range, before it is rounded."""
    return 0.000199 * r**2 - 0.000488 * r + 0.002334


def integrate(v: Array, w: Array, vy: Array, origin: tuple[float, float, float]) -> Path:
    """Poses at the ends of cells of constant rates."""
    th = origin[2] + np.concatenate([[0.0], np.cumsum(w) * DT])
    mid = th[:-1] + w * DT / 2
    x = origin[0] + np.concatenate([[0.0], np.cumsum(v * np.cos(mid) - vy * np.sin(mid)) * DT])
    y = origin[1] + np.concatenate([[0.0], np.cumsum(v * np.sin(mid) + vy * np.cos(mid)) * DT])
    return Path(x, y, th, v, w)


def held(commands: Array, cells: int) -> tuple[Array, Array]:
    """Mean of the commands that are held, in each cell of the grid."""
    edges = DT * np.arange(cells + 1)
    t = np.append(commands[:, 0], max(edges[-1], commands[-1, 0]) + 1)
    out = []
    for column in (1, 2):
        total = np.concatenate([[0.0], np.cumsum(commands[:, column] * np.diff(t))])
        out.append(np.diff(np.interp(edges, t, total)) / DT)
    v, w = (np.where(np.abs(u) < 1e-9, 0.0, u) for u in out)
    return v, w
