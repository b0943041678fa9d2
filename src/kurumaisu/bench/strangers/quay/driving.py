# SPDX-License-Identifier: BSD-3-Clause
"""Drives: commands as people and planners give them, noise, the reference's rows, columns beside."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.quay.base import DT, Drive, Effects, drive_on
from kurumaisu.bench.strangers.quay.reference import refer
from kurumaisu.bench.strangers.quay.things import Array, Rng, Robot, Room, Scene, inside

MANNERS = ("planner", "joystick", "squares", "corridor")
RISE = {"planner": 0.6, "joystick": 0.3, "squares": 0.0, "corridor": 0.8}
Pieces = list[tuple[float, float, float]]  # seconds, v, w


def _wander(rng: Rng, n: int, dt: float, tau: float) -> Array:
    """Return stationary noise of one colour, of unit sd."""
    a = float(np.exp(-dt / tau))
    e = rng.standard_normal(n) * np.sqrt(1 - a * a)
    e[0] = rng.standard_normal()
    return np.asarray(lfilter([1.0], [1, -a], e))


def _pieces(rng: Rng, manner: str, robot: Robot, way: str) -> Pieces:
    """Return a few pieces that belong together."""
    vm, wm = robot.vmax, robot.wmax
    v = vm * float(rng.choice([0.12, 0.25, 0.4, 0.6, 0.8, 1.0] if manner != "corridor" else [0.06, 0.12, 0.25, 0.45]))
    w = wm * float(rng.choice([-1, 1])) * float(rng.choice([0.1, 0.2, 0.4, 0.6, 0.9]))
    if way == "one speed":
        v, w = 0.5 * vm, wm * float(rng.choice([-0.5, 0.5]))
        return [[(3.0, v, w), (1.5, 0.0, 0.0), (3.0, 0.0, w), (2.5, v, 0.0)][int(rng.integers(4))]]
    if way == "one side":
        w = abs(w)
    dur = float(rng.uniform(1.5, 4))
    k = float(rng.random())
    if k < 0.12:
        return [(float(rng.uniform(1.0, 3.0)), 0.0, 0.0)]
    if k < 0.24:
        return [(dur, -min(v, 0.6 * vm), w * float(rng.choice([0, 0, 0.4])))]
    if manner == "squares":
        turn = 0.5 * wm * float(np.sign(w))
        return [(dur, v, 0.0), (0.6, 0.0, 0.0), (np.pi / 2 / abs(turn), 0.0, turn)] if k < 0.75 else [(dur, v, w / 2)]
    if k < 0.42:
        return [(float(rng.uniform(0.8, 3)), 0.0, w)]
    return [(dur, v, 0.0)] if k < 0.62 else [(dur, v, w)]


def _way_out(k: int, robot: Robot, way: str) -> Pieces:
    """Return what the k-th try does where nothing else fits."""
    if way == "one speed":
        return [(1.5, 0.0, 0.5 * robot.wmax), (1.0, 0.5 * robot.vmax, 0.0)]
    turn = 0.7 * robot.wmax * (1 if way == "one side" or k % 2 else -1)
    return [(1.2, 0.0, turn), (1.2, robot.vmax * (0.4 if k % 3 else -0.3), 0.0)]


def _write(rng: Rng, manner: str, dr: Drive, pieces: Pieces, i: int, hz: float) -> int:
    """Write commands of the pieces from grid index i on, at a jittered rate; return the index after them."""
    rise = RISE[manner]
    for dur, v, w in pieces:
        end = min(i + round(dur / DT), dr.n)
        v0, w0 = (dr.vc[i - 1], dr.wc[i - 1]) if i else (0.0, 0.0)
        start = i
        while i < end:
            f = 1.0 if rise == 0 else min((i - start) * DT / rise + 0.15, 1.0)
            j = float(rng.normal(0, 0.01)) if manner == "joystick" and (v or w) else 0.0
            a, b = v0 + f * (v - v0) + j * v, w0 + f * (w - w0) - j * w
            step = max(round((1 / hz + rng.normal(0, 0.08 / hz)) / DT), 1)
            if rng.random() < 0.004:
                step += int(rng.integers(10, 30))
            dr.vc[i:end], dr.wc[i:end] = round(a, 4), round(b, 4)
            if i == start or manner != "squares" or rng.random() < 0.3:
                dr.rows.append(i)
            i += step
        i = end
    return i


def _fits(pose: Array, pieces: Pieces, room: Room) -> bool:
    """Tell whether the ideal robot would stay in the room."""
    v, w = (np.concatenate([np.full(int(p[0] / 0.1) + 1, p[k]) for p in pieces]) for k in (1, 2))
    th = pose[2] + np.cumsum(w) * 0.1
    return inside(room, pose[0] + np.cumsum(v * np.cos(th)) * 0.1, pose[1] + np.cumsum(v * np.sin(th)) * 0.1)


def _begin(rng: Rng, name: str, start: float, since: float, scene: Scene, seconds: float) -> Drive:
    """Return a drive with its noise, columns and first pose, but without commands."""
    n, robot, room = int(seconds / DT), scene.robot, scene.room
    noise = robot.sd_v * _wander(rng, n, DT, robot.tau), robot.sd_w * _wander(rng, n, DT, robot.tau)
    g = np.arange(0, seconds + 1, 1.0)
    cov_t = g + float(rng.uniform(0, 0.3))
    mean, turn = 20 + rng.uniform(-1, 1), 2 * np.pi * (g + since) / rng.uniform(150, 500)
    cov = {
        "temperature": mean + 4.5 * np.sin(turn + rng.uniform(0, 6)),
        "humidity": np.clip(50 + 14 * _wander(rng, g.size, 1.0, 18.0), 20, 80),
        "battery": 25.4 - 0.002 * (g + since) + rng.normal(0, 0.01, g.size),
    }
    a, b, c, d = room.free
    for _ in range(200):
        p = np.array([rng.uniform(a, b), rng.uniform(c, d)])
        if inside(room, p[:1], p[1:]):
            break
    pose = (float(p[0]), float(p[1]), float(rng.uniform(-3, 3)))
    return Drive(name, start, n, since, *noise, cov_t, cov, pose, np.zeros(n), np.zeros(n))


def make_drive(
    rng: Rng, name: str, since: float, scene: Scene, eff: Effects, manner: str, way: str, seconds: float
) -> Drive:
    """Drive so that the robot stays in the room with what is hidden at work."""
    robot, room = scene.robot, scene.room
    dr = _begin(rng, name, scene.unix + since, since, scene, seconds)
    manner = "squares" if way == "one speed" else manner
    hz = float(rng.choice([10, 20]))
    i = _write(rng, manner, dr, [(2.0, 0.0, 0.0)], 0, hz)
    path = drive_on(dr, robot, eff, i)
    while i < dr.n:
        keep = len(dr.rows)
        for k in range(30):
            pieces = _pieces(rng, manner, robot, way)
            if k > 12:
                pieces = _way_out(k, robot, way)
            if k < 26 and "base.sign" not in eff and not _fits(path[-1], pieces, room):
                continue
            j = _write(rng, manner, dr, pieces, i, hz)
            now = drive_on(dr, robot, eff, j)
            if inside(room, now[i::10, 0], now[i::10, 1]):
                break
            del dr.rows[keep:]
            dr.vc[i:], dr.wc[i:] = 0, 0
        else:
            j = _write(rng, manner, dr, [(0.7, 0.0, 0.5 * robot.wmax)], i, hz)
            now = drive_on(dr, robot, eff, j)
        i, path = j, now
    dr.path = drive_on(dr, robot, eff, dr.n)
    return dr


def measure(rng: Rng, dr: Drive, scene: Scene, eff: Effects) -> None:
    """Enter the rows of the reference."""
    ref, end = scene.ref, dr.n * DT
    t = np.arange(0.05, end - 0.1, 1 / ref.rate)
    t = np.sort(t + rng.uniform(-0.25, 0.25, t.size) / ref.rate)
    keep = rng.random(t.size) > 0.01
    for _ in range(int(rng.integers(0, 3))):
        at = float(rng.uniform(5, end - 5))
        keep &= ~((t > at) & (t < at + rng.uniform(0.3, 1.5)))
    t = np.round(t[keep], 6)
    q = refer(dr, scene.robot, eff, dr.path, t)
    e = rng.standard_normal(q.shape) * np.array([ref.sp, ref.sp, ref.sh])
    grid = np.arange(0, end + 1, 0.2)
    for k, w in enumerate((ref.wp, ref.wp, ref.wh)):
        e[:, k] += w * np.interp(t, grid, _wander(rng, grid.size, 0.2, ref.wtau))
    off = rng.random(t.size) < 0.002
    off[:3] = off[-3:] = False
    e[off, :2] += rng.choice([-1, 1], (off.sum(), 2)) * rng.uniform(0.15, 0.5, (off.sum(), 2))
    dr.pose_t, dr.pose, dr.off = t, q + e, off


def scan_times(rng: Rng, dr: Drive, hz: float) -> None:
    """Enter the stamps of scans, with jitter, between the first and the last row of the reference."""
    t = np.arange(1.0, dr.n * DT - 1.5, 1 / hz)
    dr.scan_t = np.asarray(np.round(t + rng.uniform(-0.05, 0.05, t.size), 6), dtype=np.float64)
