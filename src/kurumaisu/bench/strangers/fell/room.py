# SPDX-License-Identifier: BSD-3-Clause
"""Rooms of boxes: their walls, the way light takes in them, and their files."""

from dataclasses import dataclass
import numpy as np


@dataclass
class Room:
    """Boxes (cx, cy, angle, sx, sy) with a flag for dark paint; walls are their edges inside of the room."""

    width: float
    height: float
    boxes: np.ndarray
    dark: np.ndarray

    def __post_init__(self) -> None:
        walls, owner = [], []
        for i, (cx, cy, a, sx, sy) in enumerate(self.boxes):
            k = np.array([[-sx, -sy], [sx, -sy], [sx, sy], [-sx, sy]]) / 2
            p = k @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + (cx, cy)
            e = [np.concatenate([p[j], p[(j + 1) % 4]]) for j in range(4)]
            if i < 4:  # of the room's own walls only the inner side
                e = [min(e, key=lambda q: np.hypot(q[0] + q[2] - self.width, q[1] + q[3] - self.height))]
            walls, owner = walls + e, owner + [i] * len(e)
        self.walls, self.owner = np.array(walls), np.array(owner)

    def shifted(self, sd: float, rng: np.random.Generator, turned: bool) -> "Room":
        """A room whose boxes lie elsewhere than the map shows, and are turned if so."""
        boxes = self.boxes.copy()
        boxes[:, :2] += sd * np.clip(rng.standard_normal((len(boxes), 2)), -2, 2)
        boxes[:, 2] += 0.3 * sd * rng.standard_normal(len(boxes)) * turned
        return Room(self.width, self.height, boxes, self.dark)

    def clearance(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Distance of points from the nearest box, negative outside of the room."""
        b = self.boxes
        dx, dy, c, s = x[:, None] - b[:, 0], y[:, None] - b[:, 1], np.cos(b[:, 2]), np.sin(b[:, 2])
        u, v = np.abs(c * dx + s * dy) - b[:, 3] / 2, np.abs(c * dy - s * dx) - b[:, 4] / 2
        d = np.hypot(np.maximum(u, 0), np.maximum(v, 0)) + np.minimum(np.maximum(u, v), 0)
        return np.min([d.min(1), x, self.width - x, y, self.height - y], 0)

    def cast(self, ox: np.ndarray, oy: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ranges of rays to the walls, and the index of the wall hit."""
        dx, dy, best, which = np.cos(angle), np.sin(angle), np.full(ox.shape, 99.0), np.zeros(ox.shape, int)
        for i, (x0, y0, x1, y1) in enumerate(self.walls):
            ex, ey, px, py = x1 - x0, y1 - y0, x0 - ox, y0 - oy
            den = dx * ey - dy * ex
            with np.errstate(divide="ignore", invalid="ignore"):
                t, u = (px * ey - py * ex) / den, (px * dy - py * dx) / den
                hit = (t > 1e-6) & (t < best) & (u >= -1e-9) & (u <= 1 + 1e-9)
            best[hit], which[hit] = t[hit], i
        return best, which

    def world(self) -> str:
        """The Stage world."""
        out = ['name "room"', 'define wall model ( color "gray30" gui_move 0 )']
        for i, ((cx, cy, a, sx, sy), dark) in enumerate(zip(self.boxes, self.dark)):
            out.append(
                f'wall ( name "b{i}" pose [{cx:.6f} {cy:.6f} 0 {np.degrees(a):.9f}] '
                f'size [{sx:.6f} {sy:.6f} 1.0] color "{"black" if dark else "white"}" )'
            )
        return "\n".join(out) + "\n"


def draw_room(rng: np.random.Generator, reach: float) -> Room:
    """A hall with posts, a flat, a corridor with niches, or a workshop with benches."""
    sort = rng.choice(["hall", "flat", "corridor", "workshop"])
    w, h = rng.uniform(8, 12), rng.uniform(7, 9)
    if reach < 5:
        w, h, sort = rng.uniform(5.0, 6.5), rng.uniform(4.6, 6.0), "flat" if sort == "corridor" else sort
    elif sort == "corridor":
        w, h = rng.uniform(13, 18), rng.uniform(3.6, 4.5)
    w, h, u = round(w, 3), round(h, 3), rng.uniform
    boxes = [
        (w / 2, -0.05, 0, w + 0.2, 0.1),
        (w / 2, h + 0.05, 0, w + 0.2, 0.1),
        (-0.05, h / 2, 0, 0.1, h),
        (w + 0.05, h / 2, 0, 0.1, h),
    ]
    if sort == "hall":
        for fx, fy in ((0.3, 0.3), (0.7, 0.32), (0.68, 0.72), (0.28, 0.7)):
            boxes.append(
                (w * (fx + u(-0.05, 0.05)), h * (fy + u(-0.05, 0.05)), rng.choice([0.0, 0.785]), s := u(0.2, 0.4), s)
            )
    elif sort == "flat":
        side, x = (h - u(1.5, 1.8)) / 2, w * u(0.45, 0.55)
        boxes += [(x, side / 2, 0, 0.12, side), (x, h - side / 2, 0, 0.12, side), (w - 0.3, h * 0.8, 0, 0.6, 0.9)]
    elif sort == "corridor":
        for k in range(4):
            boxes.append(
                (w * (k + u(0.3, 0.7)) / 4, abs((0 if k % 2 else h) - (d := u(0.25, 0.6)) / 2), 0, u(0.6, 1.4), d)
            )
    else:
        boxes += [
            (w * 0.3, 0.35, 0, u(1, 1.8), 0.7),
            (w - 0.4, h * 0.35, 0, 0.8, u(0.8, 1.5)),
            (0.6, h - 0.6, u(0.3, 0.9), 0.9, 0.5),
        ]
    boxes += [(w - 0.35, u(0.4, 0.6), u(0.2, 0.6), 0.5, 0.4)] if sort != "workshop" else []
    dark = np.array([True, False, *(rng.random(len(boxes) - 2) < 0.4)])
    return Room(w, h, np.round(np.array(boxes, float), 6), dark)
