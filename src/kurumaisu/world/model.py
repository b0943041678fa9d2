# SPDX-License-Identifier: BSD-3-Clause
"""What a world consists of: a tree of models with their shapes and devices. SI units and radians throughout."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Place:
    """Where in a file something was said; line and column count from 1."""

    file: Path
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Shape:
    """Outlines of a body in the frame of its model's pose (origin applied), standing on the model's base.

    segments: (m, 4), x and y of both ends [m]; heights: (m, 2), lowest and highest z above the base [m];
    polygons: closed polygons (k, 2) [m] of blocks and boxes, for contact and drawing, with their heights (2,) and
    colours; a bitmap has segments only.
    edges: (k, 6), the same outlines as Stage draws them into cells, to the last bit: x and y from and to, lowest and
    highest z [m], before the origin is applied; None: the segments, and no origin.
    """

    segments: FloatArray
    heights: FloatArray
    polygons: tuple[Polygon, ...]
    edges: FloatArray | None = None


@dataclass(frozen=True)
class Polygon:
    """A prism: corners (k, 2) [m], heights (2,) [m], colour (4,) of red, green, blue, alpha in [0, 1]."""

    corners: FloatArray
    heights: FloatArray
    color: tuple[float, float, float, float]


@dataclass(frozen=True)
class Position:
    """A robot base. localization_origin, odom_error, velocity: (4,) of x, y, z, heading [m, rad, 1, m/s, rad/s].

    drive: diff, omni or car; localization: gps or odom; velocity_bounds, acceleration_bounds: (4, 2), lowest and
    highest of x, y, z, heading [m/s, rad/s, m/s^2, rad/s^2]; None: not given. wheelbase [m] of a car.
    """

    drive: str
    localization: str
    localization_origin: FloatArray | None
    odom_error: FloatArray | None
    velocity_bounds: FloatArray
    acceleration_bounds: FloatArray | None
    wheelbase: float
    velocity: FloatArray


@dataclass(frozen=True)
class Fan:
    """One `sensor` of a ranger: pose (4,) in the ranger's frame; height: size.z [m], the beam is at half of it.

    Ranges [m], fov [rad]; noise (3,): variance [m^2], share of the range [1], angle [rad], as Stage has them.
    """

    pose: FloatArray
    height: float
    range_min: float
    range_max: float
    fov: float
    samples: int
    noise: FloatArray
    place: Place


@dataclass(frozen=True)
class Ranger:
    """A laser or a ring of sonars."""

    fans: tuple[Fan, ...]


@dataclass(frozen=True)
class Camera:
    """A colour and depth camera: pixels, fields of view, pan and tilt [rad], nearest and farthest range [m]."""

    width: int
    height: int
    fov_h: float
    fov_v: float
    near: float
    far: float
    pan: float
    tilt: float


@dataclass(frozen=True)
class Fiducial:
    """A finder of marked models: ranges [m], fov [rad]; key: finds models of the same fiducial_key."""

    range_min: float
    range_max: float
    range_max_id: float
    fov: float
    ignore_zloc: bool
    key: int


@dataclass(frozen=True)
class Bumper:
    """Contact strips: poses (n, 4) in the model's frame and lengths (n,) [m]."""

    poses: FloatArray
    lengths: FloatArray


@dataclass(frozen=True)
class Gripper:
    """A gripper: paddle_size (3,) as shares of the model's size; state: open or closed at the start."""

    paddle_size: FloatArray
    open: bool
    autosnatch: bool


Device = Position | Ranger | Camera | Fiducial | Bumper | Gripper


@dataclass(frozen=True)
class Hinge:
    """An addition to Stage's language: the model turns about a point (2,) of its own frame between two angles [rad]."""

    anchor: FloatArray
    lowest: float
    highest: float


@dataclass(frozen=True)
class Walk:
    """An addition to Stage's language: the model walks by itself, from waypoint to waypoint (k, 2) of the map [m].

    speed [m/s]; mode: loop (round and round), yoyo (there and back) or once (and stays); social: it gives way to
    others and to walls.
    """

    waypoints: FloatArray
    speed: float
    mode: str
    social: bool


@dataclass(frozen=True)
class Model:
    """One model of the tree, in depth-first file order.

    parent, root: indices in World.models of the model it stands on (-1: the ground) and of its top-level ancestor;
    pose (4,): x, y, z [m], heading [rad] in the parent's frame, z counted from the parent's top (its base if the parent
    does not stack its children); origin (4,); size (3,) [m]; name: as in the file, or None; type: Stage's word.
    ranger_return: below 0 invisible to rangers, else the intensity of a hit; obstacle_return: False: no collisions;
    mass [kg], 0: not given; friction [1], None: not given; update_interval [s].
    device: what a typed model does; None: of a type that only has a body; walk: None: goes nowhere by itself.
    source: what its file says of it, but name and pose, as any other file can; "": it is in none.
    slope (2,): an addition to Stage's language: rise per metre along x and y of the pose's frame [1], in the outline.
    """

    index: int
    parent: int
    root: int
    type: str
    name: str | None
    place: Place
    pose: FloatArray
    origin: FloatArray
    size: FloatArray
    color: tuple[float, float, float, float]
    shape: Shape
    stack_children: bool
    ranger_return: float
    obstacle_return: bool
    fiducial_return: int
    fiducial_key: int
    gripper_return: bool
    mass: float
    friction: float | None
    update_interval: float
    hinge: Hinge | None
    device: Device | None
    walk: Walk | None = None
    slope: FloatArray | None = None
    source: str = ""
