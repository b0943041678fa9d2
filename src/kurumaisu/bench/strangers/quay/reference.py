# SPDX-License-Identifier: BSD-3-Clause
"""What the reference measures of a path, and how sure the motions between its rows are."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.quay.base import DT, Drive, Effects, quantity
from kurumaisu.bench.strangers.quay.things import Array, Ints, Reference, Robot


def refer(dr: Drive, robot: Robot, eff: Effects, path: Array, t: Array) -> Array:
    """Return what the reference measures of a path at its stamps t, without its errors."""
    if p := eff.get("base.clock_scale"):
        t = t * (1 - p["scale"])
    q = dr.at(t, path)
    x, y = (eff.get(k, {}).get(k[-1], 0.0) for k in ("base.marker_x", "base.marker_y"))
    c, s = np.cos(q[:, 2]), np.sin(q[:, 2])
    q = q + np.stack([c * x - s * y, s * x + c * y, 0 * c + eff.get("base.marker_yaw", {}).get("yaw", 0.0)], -1)
    if p := eff.get("unknown.pose"):
        z = p["shape"](quantity(dr, robot, p["of"], dr.path[:-1], dr.vc, dr.wc))
        q[:, p["part"]] += p["size"] * np.interp(t, np.arange(dr.n) * DT, z)
    return np.asarray(q)


def elsewhere(eff: Effects) -> bool:
    """Tell whether the reference measures something else than base_link."""
    return any(k.startswith(("base.marker", "base.clock", "unknown.pose")) for k in eff)


def relative(q: Array, i: Ints, j: Ints) -> Array:
    """Return the motion from rows i to rows j in the frame of the first."""
    d = q[j] - q[i]
    c, s = np.cos(q[i, 2]), np.sin(q[i, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], d[:, 2]], -1)


def motion_cov(dr: Drive, robot: Robot, ref: Reference, t: Array, grow: Array) -> Array:
    """Return the covariance of the motions between times t, from process noise and reference."""
    i, m = np.arange(len(t) - 1), 10
    n = i.size
    a, b = t[i], t[i + 1]
    h = (b - a) / m
    tk = a[:, None] + (np.arange(m) + 0.5) * h[:, None]
    qa, qb, qk = dr.at(a), dr.at(b), dr.at(tk)
    rel = qk[..., 2] - qa[:, None, 2]
    e = qb[:, None, :2] - qk[..., :2]
    c, s = np.cos(qa[:, 2])[:, None], np.sin(qa[:, 2])[:, None]
    ex, ey = c * e[..., 0] + s * e[..., 1], -s * e[..., 0] + c * e[..., 1]
    jv, jw = np.zeros((3, n, n, m)), np.zeros((3, n, n, m))
    d, hh = np.arange(n), h[:, None]
    jv[0, d, d], jv[1, d, d] = np.cos(rel) * hh, np.sin(rel) * hh
    jw[0, d, d], jw[1, d, d], jw[2, d, d] = -ey * hh, ex * hh, hh
    g = np.interp(tk.ravel(), np.arange(grow.size) * DT, grow)
    k = np.exp(-abs(tk.ravel()[:, None] - tk.ravel()) / robot.tau) * g[:, None] * g
    x = h.mean() / robot.tau
    k *= 1 + (2 * (x - 1 + np.exp(-x)) / x**2 - 1) * np.eye(len(k))
    jv, jw = jv.reshape(3 * n, -1), jw.reshape(3 * n, -1)
    cov = robot.sd_v**2 * jv @ k @ jv.T + robot.sd_w**2 * jw @ k @ jw.T
    near = abs(t[:, None] - t)
    old = np.exp(-near / ref.wtau)
    same = near < 1e-9
    mo = relative(dr.at(t), i, i + 1)
    co, si = np.cos(qa[:, 2]), np.sin(qa[:, 2])
    j = np.zeros((3, n, 3, len(t)))
    for row, (p, q) in enumerate(((co, si), (-si, co))):
        j[row, d, 0, i + 1], j[row, d, 0, i], j[row, d, 1, i + 1], j[row, d, 1, i] = p, -p, q, -q
    j[0, d, 2, i], j[1, d, 2, i] = mo[:, 1], -mo[:, 0]
    j[2, d, 2, i + 1], j[2, d, 2, i] = 1, -1
    for part, (sd, wd) in enumerate(((ref.sp, ref.wp), (ref.sp, ref.wp), (ref.sh, ref.wh))):
        jj = j[:, :, part].reshape(3 * n, -1)
        cov += jj @ (sd**2 * same + wd**2 * old) @ jj.T
    return np.asarray(cov)
