# SPDX-License-Identifier: BSD-3-Clause
"""A drive with a gyro of known bias, mounting and scale, of a robot whose turns are known: for tests."""

import numpy as np

DT = 0.02  # [s]
BIAS = (0.01, -0.02, 0.02)  # [rad/s]
SPEEDS = (0.0, 0.3, 0.5, -0.3, 0.0, 0.4, 0.0, -0.2, 0.5, 0.2, 0.0, 0.3)
TURNS = (0.0, 0.5, -0.3, 0.4, 0.0, -0.6, 0.7, 0.3, 0.0, -0.5, -0.7, 0.2)


def lagged(rates, tau):
    """Return rates (n,) after a first-order lag [s]."""
    out, at = np.zeros(len(rates)), 0.0
    for i, rate in enumerate(rates):
        out[i] = at
        at += (rate - at) * DT / tau
    return out


def path(v, w):
    """Return poses (n, 3) of rates (n,) that hold from row to row."""
    theta = np.append(0.0, np.cumsum(w[:-1] * DT))
    middle = theta + w * DT / 2
    x, y = (np.append(0.0, np.cumsum(v[:-1] * f(middle[:-1]) * DT)) for f in (np.cos, np.sin))
    return np.column_stack([x, y, theta])


def drive(seed=1, seconds=120.0, turned=1.0, veer=0.0, lag=0.25, noise=0.02):
    """Return tables: commands, odometry that thinks it turns as its wheels say, the true poses, and the yaw rate.

    turned: how far the robot turns where its odometry says 1; veer [rad/m]; noise [rad/s] of its turning on the floor.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, DT)
    piece = (t // 4).astype(int)
    v, w = np.array(SPEEDS)[piece % 12], np.array(TURNS)[piece * 5 % 12]
    still = piece % 9 == 0
    v, w = np.where(still, 0.0, v), np.where(still, 0.0, w)
    wheel_v, wheel_w = lagged(v, lag), lagged(w, lag)
    rough = lagged(rng.normal(0.0, noise * np.sqrt(2 * 0.3 / DT), len(t)), 0.3)
    rough *= np.hypot(wheel_v, wheel_w) > 0.02
    real = turned * wheel_w + veer * wheel_v + rough
    rows = slice(None, None, 5)
    odom = np.column_stack([t, path(wheel_v, wheel_w), wheel_v, wheel_w])[rows]
    odom[:, 1:3] = odom[:, 1:3].round(4)
    return {
        "command": np.column_stack([t, v, w])[rows],
        "odom": odom,
        "pose": np.column_stack([t, path(wheel_v, real)])[rows],
        "yaw": np.column_stack([t, real]),
    }


def gyro(yaw, up=(0.0, 0.0, 1.0), bias=BIAS, scale=1.0, gravity=9.81, seed=2):
    """Return rows of t, wx, wy, wz, ax, ay, az of a gyro of which that direction is up; yaw (n, 2) of t, w."""
    rng = np.random.default_rng(seed)
    up = np.asarray(up, dtype=float) / np.linalg.norm(up)
    rates = scale * yaw[:, 1:] * up + bias + rng.normal(0.0, 0.008, (len(yaw), 3))
    return np.column_stack([yaw[:, 0], rates, gravity * up + rng.normal(0.0, 0.3, (len(yaw), 3))])
