# SPDX-License-Identifier: BSD-3-Clause
"""A room with furniture, and drivers of different habits who steer by where the chair really is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .plant import Array, Flags, limit

STYLES = {  # how often each manoeuvre is chosen: goto, turn, rest, reverse, eight, circle
    "wander": (6, 1, 1, 1.5, 1, 1),
    "eights": (1.5, 0, 0.5, 0.6, 6, 1),
    "stops": (5, 3, 3, 2, 0, 0),
    "careful": (4, 2, 2, 2, 1, 2),
    "one_speed": (0, 0, 0.2, 0, 3, 2),
    "lines": (5, 0, 1, 0, 0, 0),
    "left": (0, 1, 1, 1, 0, 5),
    "one_circle": (0, 0, 0.3, 0, 0, 5),
    "forward": (5, 0, 1, 0, 3, 2),
}
MOST = np.array([0.8, 1.0])
NAMES = ("goto", "turn", "rest", "reverse", "eight", "circle")


@dataclass
class Room:
    """Boxes (x, y, heading, length, thickness), the middle of the free floor and half its width and depth."""

    boxes: Array
    dark: Flags
    middle: tuple[float, float]
    free: tuple[float, float]

    def segments(self, boxes: Array | None = None) -> Array:
        """Sides of the boxes as (x1, y1, x2, y2), four for each box in turn."""
        b = self.boxes if boxes is None else boxes
        c, s = np.cos(b[:, 2]), np.sin(b[:, 2])
        corner = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
        p = [
            (b[:, 0] + (i * b[:, 3] * c - j * b[:, 4] * s) / 2, b[:, 1] + (i * b[:, 3] * s + j * b[:, 4] * c) / 2)
            for i, j in corner
        ]
        sides = [np.stack([*p[i], *p[(i + 1) % 4]], axis=1) for i in range(4)]
        return np.asarray(np.stack(sides, axis=1).reshape(-1, 4))

    def text(self, boxes: Array, dark: bool) -> str:
        """The Stage world."""
        lines = []
        for i, (x, y, a, length, thick) in enumerate(boxes):
            back = 0.5 if dark and self.dark[i] else 1
            name = f'model ( name "w{i + 1}" pose [ {x:.4f} {y:.4f} 0 {np.degrees(a):.4f} ]'
            lines.append(f"{name} size [ {length:.4f} {thick:.4f} 1.0 ] ranger_return {back} )")
        return "\n".join(lines) + "\n"


def make_room(rng: np.random.Generator) -> Room:
    """Four walls, and furniture along them."""
    wide, deep = rng.uniform(6.2, 9.0), rng.uniform(6.0, 7.2)
    mx, my = rng.uniform(-3, 3, 2)
    boxes = [[mx, my + deep / 2, 0, wide, 0.1], [mx, my - deep / 2, 0, wide, 0.1]]
    boxes += [[mx - wide / 2, my, np.pi / 2, deep, 0.1], [mx + wide / 2, my, np.pi / 2, deep, 0.1]]
    for _ in range(int(rng.integers(9, 16))):
        side, along, size = int(rng.integers(4)), rng.uniform(-0.46, 0.46), rng.uniform((0.3, 0.15), (1.3, 0.5))
        out = 0.5 * (deep if side < 2 else wide) - size[1] / 2 - rng.uniform(0.05, 0.45)
        sign = 1 if side % 2 else -1
        x, y = (along * wide, sign * out) if side < 2 else (sign * out, along * deep)
        turn = rng.choice([0.0, rng.normal(0, 0.25)]) + (0 if side < 2 else np.pi / 2)
        boxes.append([mx + x, my + y, turn, size[0], size[1]])
    dark = rng.random(len(boxes)) < 0.35
    dark[:2], dark[-1] = (True, False), True
    return Room(np.array(boxes), dark, (mx, my), (wide / 2 - 1.75, deep / 2 - 1.75))


class Driver:
    """A person with a joystick: manoeuvres with pauses, hands of limited speed and a slight tremor."""

    def __init__(self, rng: np.random.Generator, room: Room, style: str, still: tuple[float, float]) -> None:
        self.rng, self.room, self.style, self.still = rng, room, style, still
        self.fast, self.turns = rng.uniform(0.35, 0.8), rng.uniform(0.5, 1.0)
        self.hand = np.array([rng.uniform(0.5, 1.2), rng.uniform(1.0, 2.5)])
        self.now: Array = np.zeros(2)
        self.tremor, self.last, self.until = 0.0, 0.0, rng.uniform(0.5, 2.0)
        self.task, self.aim, self.goal, self.home = "rest", np.zeros(2), np.zeros(2), False
        if style in ("one_speed", "one_circle", "lines"):
            self.aim = np.array([self.fast * 0.7, self.turns * 0.8])
        self.fixed = self.aim.copy()

    def step(self, t: float, pose: Array) -> Array:
        """Command at t."""
        dt, self.last = t - self.last, t
        left = self._outside(pose)
        if left and not self.home and self.task != "rest":
            self._home(t)
        elif t > self.until:
            self._choose(t, pose)
        want = self._want(t, pose)
        if self.still[1] > 0 and self.still[0] < t < self.still[1] + 0.4:
            want = np.array([0.3, 0.0])
        self.tremor += dt * (-self.tremor / 0.4) + self.rng.normal() * 0.02 * np.sqrt(dt)
        self.now = self.now + limit(want - self.now, -self.hand * dt, self.hand * dt)
        out: Array = np.asarray(np.round(self.now, 3), np.float64)
        if abs(want).sum() > 0 and self.style not in ("one_speed", "one_circle", "lines", "left"):
            out = np.asarray(np.round(self.now * (1 + np.array([0.3, 1.0]) * self.tremor), 3), np.float64)
        return limit(out, -MOST, MOST) + 0.0

    def _outside(self, pose: Array) -> bool:
        d = pose[:2] - self.room.middle
        return bool(abs(d[0]) > self.room.free[0] or abs(d[1]) > self.room.free[1])

    def _home(self, t: float) -> None:
        self.home, self.task, self.until = True, "goto", t + 7
        self.goal = np.array(self.room.middle) + self.rng.uniform(-0.4, 0.4, 2) * np.array(self.room.free)
        if self.style in ("left", "one_circle"):
            self.task, self.until = "left", t + 9

    def _choose(self, t: float, pose: Array) -> None:
        rng, self.home = self.rng, False
        share = np.array(STYLES[self.style], dtype=np.float64)
        self.task = str(rng.choice(NAMES, p=share / share.sum()))
        v, w = self.fast * rng.uniform(0.4, 1.0), self.turns * rng.uniform(0.4, 1.0)
        if self.style in ("one_speed", "one_circle", "lines"):
            v, w = self.fixed[0], self.fixed[1]
        w = w if self.style in ("left", "one_circle") or rng.random() < 0.5 else -w
        self.aim = np.array([v, w])
        long = {
            "goto": 7.0,
            "turn": 1.0 + 2.5 * rng.random(),
            "rest": 0.8 + 1.7 * rng.random(),
            "reverse": 1.5 + 2.5 * rng.random(),
        }
        self.until = t + long.get(self.task, 5.0 + 5.0 * rng.random())
        self.goal = np.array(self.room.middle) + rng.uniform(-1, 1, 2) * np.array(self.room.free) * 0.8
        self.begin = t

    def _want(self, t: float, pose: Array) -> Array:
        v, w = self.aim
        d = self.goal - pose[:2]
        e = (np.arctan2(d[1], d[0]) - pose[2] + np.pi) % (2 * np.pi) - np.pi
        if self.task == "rest":
            return np.zeros(2)
        if self.task == "turn":
            return np.array([0.0, w])
        if self.task == "reverse":
            return np.array([-v * 0.7, 0.25 * w])
        if self.task == "circle":
            return np.array([v, w])
        if self.task == "eight":
            return np.array([v, abs(w) * 1.2 * np.sin(2 * np.pi * (t - self.begin) / 8)])
        if self.task == "left":
            return self._left(t, d, e)
        if np.hypot(*d) < 0.3:
            self.until = t
        if abs(e) > 0.6 and self.style in ("stops", "lines"):
            return np.array([0.0, abs(w) * np.sign(e)])
        steady = self.style in ("one_speed", "lines")
        return np.array([v if steady else v * max(0.2, np.cos(e)), np.clip(1.5 * e, -abs(w), abs(w))])

    def _left(self, t: float, d: Array, e: float) -> Array:
        """Turn left only, until the goal lies ahead."""
        v, w = self.aim if self.style == "left" else self.fixed
        if np.hypot(*d) < 0.4:
            self.until = t
        if abs(e) > 0.25:
            return np.array([0.0 if self.style == "left" else v, abs(w)])
        return np.array([v, 0.0])
