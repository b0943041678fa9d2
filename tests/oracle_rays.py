# SPDX-License-Identifier: BSD-3-Clause
"""A laser on a chair in an empty rectangular room once more: arcs in closed form, rays against planes in space.

No code of the package; metres, radians, seconds.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Room:
    """Inner faces of four walls, without an end above; the floor is at 0."""

    west: float
    east: float
    south: float
    north: float

    def scaled(self, factor: float) -> "Room":
        return Room(*(factor * side for side in (self.west, self.east, self.south, self.north)))


@dataclass(frozen=True)
class Arc:
    """A chair that stands until 0 and then drives at constant rates."""

    x: float
    y: float
    heading: float
    v: float
    w: float

    def at(self, t: float) -> tuple[float, float, float]:
        t = max(t, 0.0)
        if self.w == 0:
            return (
                self.x + self.v * t * math.cos(self.heading),
                self.y + self.v * t * math.sin(self.heading),
                self.heading,
            )
        end, radius = self.heading + self.w * t, self.v / self.w
        x = self.x + radius * (math.sin(end) - math.sin(self.heading))
        return x, self.y - radius * (math.cos(end) - math.cos(self.heading)), end


@dataclass(frozen=True)
class Laser:
    """Where it is on the chair, and how it is tilted: nose down by pitch, then (about its own axis) left side up."""

    x: float = 0.3
    y: float = 0.0
    z: float = 0.4
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0


def direction(laser: Laser, bearing: float, heading: float) -> tuple[float, float, float]:
    """Return a beam's unit vector in the map: the laser's own axes, drawn in space, weighted."""
    cp, sp, cr, sr = math.cos(laser.pitch), math.sin(laser.pitch), math.cos(laser.roll), math.sin(laser.roll)
    nose = (cp, 0.0, -sp)  # where its front points, in the frame of its foot
    side = (sp * sr, cr, cp * sr)  # its left: up by roll, then carried along by the pitch
    x, y, z = (math.cos(bearing) * a + math.sin(bearing) * b for a, b in zip(nose, side, strict=True))
    turn = heading + laser.yaw
    return x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn), z


def ray(room: Room, arc: Arc, laser: Laser, bearing: float, fired: float) -> float:
    """Return how far a beam goes to what it meets first."""
    x, y, heading = arc.at(fired)
    x += laser.x * math.cos(heading) - laser.y * math.sin(heading)
    y += laser.x * math.sin(heading) + laser.y * math.cos(heading)
    dx, dy, dz = direction(laser, bearing, heading)
    ways = [
        ((room.east if dx > 0 else room.west) - x) / dx if dx else math.inf,
        ((room.north if dy > 0 else room.south) - y) / dy if dy else math.inf,
        -laser.z / dz if dz < 0 else math.inf,
    ]
    return min(ways)
