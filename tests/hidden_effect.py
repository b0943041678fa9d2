# SPDX-License-Identifier: BSD-3-Clause
"""Recordings with a hidden effect, made by code that shares nothing with the package.

Own voltage law (typed from the paper), own integrator (midpoint rule at 1 ms), own forms of the effects: a lag is
a differential equation, a delay is a queue, a dead zone is in volts before the law, noise is Euler-Maruyama.
"""

from collections import deque

import numpy as np

EFFECTS = {  # id: how large, drawn uniformly with either sign where that makes sense
    "base.gain_v": (0.08, 0.15, True),
    "base.gain_w": (0.10, 0.20, True),
    "base.left_right_gain": (0.08, 0.16, True),
    "base.veer": (0.06, 0.15, True),
    "base.dead_zone_v": (0.06, 0.12, False),
    "base.dead_zone_w": (0.04, 0.08, False),
    "base.delay": (0.10, 0.25, False),
    "base.lag_v": (0.20, 0.40, False),
    "base.lag_w": (0.20, 0.40, False),
}
STEP = 0.001  # [s]


def draw_size(effect: str, rng: np.random.Generator) -> float:
    low, high, signed = EFFECTS[effect]
    return rng.uniform(low, high) * (rng.choice([-1, 1]) if signed else 1)


def joystick(seconds: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Commands (t, v, w) as a person with a joystick gives them: held for a while, sometimes at rest or reversing."""
    rows, t = [], 0.0
    while t < seconds:
        kind = rng.random()
        v = 0.0 if kind < 0.15 else rng.uniform(0.15, 0.7) * (-1 if kind > 0.85 else 1)
        w = 0.0 if rng.random() < 0.25 else rng.uniform(0.1, 0.7) * rng.choice([-1, 1])
        rows.append((t, v, w))
        t += rng.uniform(0.8, 3.0)
    rows.append((seconds, 0.0, 0.0))
    return np.array(rows)


def volts(rate: float, law: tuple) -> float:
    (slope_p, cut_p), (slope_n, cut_n) = law
    return 0.0 if rate == 0 else slope_p * rate + cut_p if rate > 0 else slope_n * rate + cut_n


FORWARD = ((1.32402, 0.127906), (2.07369, -0.108783))
STEER = ((-0.499211, 0.104181), (-0.469278, -0.169476))


def through_dead_zone(rate: float, width: float, law: tuple) -> float:
    """The controller subtracts a width [V] from the part of the voltage beyond the branch's threshold."""
    if rate == 0:
        return 0.0
    slope, _ = law[0] if rate > 0 else law[1]
    beyond = abs(slope * rate)
    return np.sign(rate) * max(beyond - width, 0.0) / abs(slope)


def make_run(
    effect: str | None,
    size: float,
    seed: int,
    seconds: float = 60.0,
    noise: tuple[float, float, float] = (0.01, 0.02, 0.3),
    truth: tuple[float, float] = (0.005, 0.005),
) -> dict[str, np.ndarray]:
    """One drive as arrays: command (t, v, w), voltage (t, v_f, v_s), pose (t, x, y, theta)."""
    rng = np.random.default_rng(seed)
    command = joystick(seconds, rng)
    n = round((seconds + 1.0) / STEP)
    queue = deque([(0.0, 0.0)] * (round(size / STEP) if effect == "base.delay" else 0))
    v = w = ou_v = ou_w = x = y = theta = 0.0
    poses, row = [], 0
    for k in range(n):
        t = k * STEP
        while row + 1 < len(command) and command[row + 1, 0] <= t:
            row += 1
        queue.append((command[row, 1], command[row, 2]))
        target_v, target_w = queue.popleft()
        if effect == "base.dead_zone_v":
            target_v = through_dead_zone(target_v, size, FORWARD)
        if effect == "base.dead_zone_w":
            target_w = through_dead_zone(target_w, size, STEER)
        if effect == "base.gain_v":
            target_v *= 1 + size
        if effect == "base.gain_w":
            target_w *= 1 + size
        if effect == "base.left_right_gain":
            target_w *= 1 + size if target_w > 0 else 1 - size
        if effect == "base.veer":
            target_w += size * target_v
        v = v + STEP / size * (target_v - v) if effect == "base.lag_v" else target_v
        w = w + STEP / size * (target_w - w) if effect == "base.lag_w" else target_w
        sd_v, sd_w, tau = noise
        ou_v += -ou_v * STEP / tau + sd_v * np.sqrt(2 * STEP / tau) * rng.standard_normal()
        ou_w += -ou_w * STEP / tau + sd_w * np.sqrt(2 * STEP / tau) * rng.standard_normal()
        if k % 100 == 0:
            sigma = [truth[0], truth[0], truth[1]]
            poses.append([t, *(np.array([x, y, theta]) + sigma * rng.standard_normal(3))])
        moving = target_v != 0 or target_w != 0
        now_v, now_w = v + moving * ou_v, w + moving * ou_w
        x += STEP * now_v * np.cos(theta + 0.5 * STEP * now_w)
        y += STEP * now_v * np.sin(theta + 0.5 * STEP * now_w)
        theta += STEP * now_w
    voltage = np.array([[t, volts(cv, FORWARD), volts(cw, STEER)] for t, cv, cw in command])
    return {"command": command, "voltage": voltage, "pose": np.array(poses)}
