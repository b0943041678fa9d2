# SPDX-License-Identifier: BSD-3-Clause
"""Draw a robot, its reference, its laser and its room."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from kurumaisu.bench.strangers.knoll.catalogue import LASER, SCATTER, VOLTAGE
from kurumaisu.bench.strangers.knoll.room import draw_room
from kurumaisu.bench.strangers.knoll.things import Covariates, Fan, Reference, Rng, Scene
from kurumaisu.types import FloatArray

_DEG = np.pi / 180
_URG = (0.002334, -0.000488, 0.000199)
_FANS = (
    Fan("URG-04LX", -2.086214, 0.006135923, 682, 9.765625e-5, 0.1, 0.06, 4.0, _URG, 1.004587, 0.058826),
    Fan("LMS200", -np.pi / 2, _DEG, 181, 7.4e-5, 0.0267, 0.1, 8.1, (0.005, 0, 0.00005)),
    Fan("UTM-30LX", -2.35619449, np.pi / 240, 361, 5.2e-5 * 2, 0.05, 0.1, 30, (0.008, 0, 0.00002)),
    Fan("LDS-01", 0.0, _DEG, 360, 0.2 / 360, 0.2, 0.12, 3.5, (0.006, 0, 0.0008)),
    Fan("TiM571", -2.35619449, _DEG, 271, 0.0667 / 360, 0.0667, 0.05, 25, (0.01, 0, 0.0)),
    Fan("RPLIDAR-A1", -np.pi, _DEG, 360, 0.18 / 360, 0.18, 0.15, 12, (0.004, 0.0015, 0.0003), resolution=0.00025),
)
_ROBOTS = {  # greatest v and w, room that it needs, how likely
    "chair_v": (0.9, 1.0, 0.5, 0.25),
    "chair": (0.9, 1.0, 0.5, 0.1),
    "burger": (0.22, 1.1, 0.2, 0.18),
    "pioneer": (0.7, 1.0, 0.35, 0.17),
    "agv": (1.2, 0.9, 0.45, 0.15),
    "vacuum": (0.35, 1.1, 0.25, 0.15),
}
_REFERENCES = {  # bounds of the sd of position and heading, of the slow one of position, and of the rate
    "motion capture": ((0.0006, 0.002), (0.001, 0.003), (0.0003, 0.001), (20, 40)),
    "scan matching": ((0.004, 0.009), (0.003, 0.007), (0.002, 0.006), (8, 15)),
    "total station": ((0.002, 0.004), (0.003, 0.007), (0.001, 0.003), (8, 20)),
}


def _draw_fan(rng: Rng) -> Fan:
    fan = _FANS[rng.integers(len(_FANS))]
    x = round(rng.uniform(0.0, 0.3), 3)
    y = round(rng.uniform(-0.05, 0.05), 3) * (rng.random() < 0.5)
    yaw = round(rng.uniform(-0.1, 0.1), 3) * (rng.random() < 0.3)
    return replace(fan, mount=np.array([x, y, yaw]), height=round(rng.uniform(0.15, 0.45), 2))


def _wander(rng: Rng, mean: float, sd: float) -> Callable[[FloatArray], FloatArray]:
    """Draw a slow function of time."""
    p, f = rng.uniform(80, 500, 4), rng.uniform(0, 6.28, 4)
    return lambda t: mean + sd * np.sin(2 * np.pi * t[..., None] / p + f).sum(-1) / 2**0.5


def _draw_reference(rng: Rng) -> Reference:
    k, each = rng.integers(3), list(_REFERENCES.values())
    white_p, white_h, slow_p = ([float(rng.uniform(*bounds[i])) for bounds in each][k] for i in range(3))
    slow_h, slow_time = float(slow_p * rng.uniform(0.3, 0.6)), float(rng.uniform(20, 120))
    rate = [float(rng.uniform(*bounds[3])) for bounds in each][k]
    return Reference(list(_REFERENCES)[k], white_p, white_h, slow_p, slow_h, slow_time, rate)


def draw_scene(rng: Rng, hidden: Collection[str], humid: bool, scans: bool) -> Scene:
    """Draw a scene in which the hidden causes can show; humid: with humidities, scans: with a laser."""
    likely = [share for *_, share in _ROBOTS.values()]
    robot = "chair_v" if VOLTAGE & set(hidden) else list(_ROBOTS)[rng.choice(6, p=likely)]
    vm, wm, margin, _ = _ROBOTS[robot]
    never = "clock_scale" in hidden or "steering_law" in hidden
    fan = _draw_fan(rng) if set(LASER) & set(hidden) or (not never and rng.random() < 0.5) else None
    ref = _draw_reference(rng)
    sd_v, sd_w = (float(top * rng.uniform(0.012, 0.03)) for top in (vm, wm))
    noise_time = float(rng.uniform(0.1, 0.7))
    person, sharp = bool(rng.random() < 0.5), bool(rng.random() < 0.3)
    step, cov = int(rng.choice([5, 10, 10, 20])), Covariates()
    if rng.random() < 0.4 or "temperature" in hidden:
        cov["temperature"] = _wander(rng, 22, 4)
    if rng.random() < 0.4 or humid:
        cov["humidity"] = _wander(rng, 55, 12)
    scan_rate = float(rng.uniform(1.2, 2.2))
    strays = float(rng.choice([0, 0.001, 0.002])) if fan and not SCATTER & set(hidden) else 0.0
    fan = _draw_fan(rng) if scans and not fan else fan
    room = draw_room(rng, (fan is not None and fan.small) or robot == "burger")
    room.dark = (rng.random(len(room.things)) < 0.4).astype(float)
    room.dark[:2] = 0, 1
    law = "published" if "steering_law" in hidden else "corrected"
    return Scene(
        robot, vm, wm, margin, law, fan, ref, sd_v, sd_w, noise_time, person, sharp, step, cov, scan_rate, strays, room
    )
