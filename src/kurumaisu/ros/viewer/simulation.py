# SPDX-License-Identifier: BSD-3-Clause
"""A simulation behind ROS as a page sees it, sim_node or stageros: its topics `world` and `view`, and its services."""

from __future__ import annotations

import json
from collections import Counter
from itertools import count
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose
from std_msgs.msg import String
from std_srvs.srv import Empty, SetBool, Trigger

from kurumaisu.errors import Error
from kurumaisu.geometry import compose
from kurumaisu.msg import View
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.viewer.calls import call, done
from kurumaisu.ros.viewer.topics import Newest
from kurumaisu.srv import Delete, SaveWorld, Seed, SetPose, Spawn, Speed
from kurumaisu.types import FloatArray
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.palette import Walk, described
from kurumaisu.viewer.protocol import Body, Fan, Ranger, World
from kurumaisu.viewer.source import Outcome

ABILITIES = frozenset({"pause", "step", "speed", "reset", "seed", "set_pose", "add", "delete", "restore", "save_world"})


class SimulationSource:
    """Puts the world into the hub, and tells of the moment."""

    def __init__(self, hub: Hub, node: str, services: str) -> None:
        """node: its name; services: what is in front of its services' names."""
        self._hub = hub
        self._services = services
        self._view = Newest(f"{node}/view", View)
        self._described = Newest(f"{node}/world", String)
        self._world: dict[str, Any] = {}
        self.run = -1  # goes up when a robot was put elsewhere
        self.odometry: FloatArray | None = None  # (3,) of the first robot, in its own frame; None: it is told its pose
        self._known: dict[str, Any] = {}  # of the last view
        self._added: dict[str, str] = {}  # names by ids, also of what is yet to be described, or may come back

    def open(self) -> None:
        """Listen."""
        self._described.open()
        self._view.open()

    def close(self) -> None:
        """Listen no longer."""
        self._view.close()
        self._described.close()
        self._world, self._known = {}, {}

    def moment(self) -> tuple[dict[str, Any], dict[Ranger, Fan]] | None:
        """Return what goes into a State, and the scans that are new; None before there is anything."""
        if (described := self._described.take()) is not None:
            self._show(json.loads(described.data))
        view = self._view.take()
        if view is None or view.world != self._world.get("world"):  # its description is yet to come
            return (self._known, {}) if self._known else None
        self.run = view.run
        self.odometry = self._believed(view)
        moving = np.asarray(view.poses).reshape(-1, 3)
        still = (body for body in self._world["bodies"] if body["row"] < 0 and body["kind"] != "wall")
        poses = {body["id"]: tuple(body["pose"]) for body in still}
        rows, robot = self._rows, self._world["first"]
        poses |= {rows[row]: tuple(pose) for row, pose in enumerate(moving.tolist()) if row in rows}
        self._known = {
            "t": view.header.stamp.to_sec(),
            "rtf": float(view.real_time_factor),
            "speed": float(view.speed),
            "paused": bool(view.paused),
            "seed": int(self._world["seed"]),
            "poses": poses,
            "hit": tuple(rows[row] for row in np.flatnonzero(np.frombuffer(view.hit, np.uint8)) if row in rows),
            "contacts": {rows[row]: int(view.contacts[row]) for row in np.flatnonzero(view.contacts) if row in rows},
            "truth": poses.get(robot) if robot is not None else None,
        }
        return self._known, self._scans(view)

    def command(self, name: str, arguments: dict[str, Any]) -> Outcome:
        """Obey. Raise Error with the reason where it cannot be."""
        if name not in ABILITIES:
            raise Error(f"{name}: is not possible in a simulation")
        outcome: Outcome = getattr(self, f"_do_{name}")(**arguments)
        return outcome

    def _do_pause(self, on: bool) -> Outcome:
        return Outcome(done(f"{self._services}pause", SetBool, on))

    def _do_step(self) -> Outcome:
        return Outcome(done(f"{self._services}step", Trigger))

    def _do_speed(self, value: float) -> Outcome:
        return Outcome(done(f"{self._services}speed", Speed, value))

    def _do_seed(self, value: int) -> Outcome:
        return Outcome(done(f"{self._services}seed", Seed, value))

    def _do_reset(self) -> Outcome:
        call(f"{self._services}reset", Empty)
        return Outcome("back at the start")

    def _do_save_world(self) -> Outcome:
        answer = call(f"{self._services}save_world", SaveWorld)
        if not answer.success:
            raise Error(answer.message)
        return Outcome(str(answer.message), str(answer.world))

    def _do_delete(self, body: str) -> Outcome:
        return Outcome(self._done_to(self._known_body("delete", body), "delete", Delete))

    def _do_restore(self, body: str) -> Outcome:
        return Outcome(done(f"{self._services}restore", Delete, body))

    def _do_set_pose(self, body: str, x: float, y: float, yaw: float) -> Outcome:
        known = self._known_body("set_pose", body)
        return Outcome(self._done_to(known, "set_pose", SetPose, Pose(Point(x, y, known["z"]), quaternion_of(yaw))))

    def _do_add(self, kind: str, x: float, y: float, yaw: float, length: float, width: float, **to: float) -> Outcome:
        """Add a box, a wall or a person, who walks if it is said to where."""
        if len(to) == 1:
            raise Error("add: to_x and to_y belong together")
        walk = Walk((x, y), (to["to_x"], to["to_y"])) if to else None
        taken = {body["name"] for body in self._world.get("bodies", [])} | set(self._added.values())
        name = next(name for number in count(1) if (name := f"{kind} {number}") not in taken)
        text = described(kind, name, length, width, walk)
        answer = call(f"{self._services}spawn", Spawn, text, "", Pose(Point(x, y, 0.0), quaternion_of(yaw)))
        if not answer.success:
            raise Error(f"{name}: {answer.message}")
        self._added[answer.id] = name
        return Outcome(f"{name} was added", answer.id)

    def _known_body(self, command: str, body: str) -> dict[str, Any]:
        """Return what is known of a body. Raise Error for none, and for a wall."""
        known: dict[str, dict[str, Any]] = {one["id"]: one for one in self._world.get("bodies", [])}
        if body not in known and body not in self._added:
            raise Error(f"{command}: there is no body {body!r}")
        found = known.get(body, {"id": body, "name": self._added.get(body), "movable": True, "z": 0.0})
        if not found["movable"]:
            raise Error(f"{command}: {found['name']} is a wall, which stays where it is")
        return found

    def _done_to(self, body: dict[str, Any], service: str, kind: type, *more: Any) -> str:
        try:
            return done(f"{self._services}{service}", kind, body["id"], *more)
        except Error as error:  # the simulator says the id that it was told, which a person has never seen
            raise Error(str(error).replace(body["id"], body["name"], 1)) from error

    def _show(self, world: dict[str, Any]) -> None:
        self._world = world
        self._rows = {body["row"]: body["id"] for body in world["bodies"] if body["row"] >= 0}
        self._places = {body["row"]: place for place, body in enumerate(world["bodies"]) if body["row"] >= 0}
        robots = [body for body in world["bodies"] if body["kind"] == "robot"]
        robots.sort(key=lambda body: body["drive"] is not None)  # the chair has a controller of its own
        world["first"] = robots[0]["id"] if robots else None
        bodies = tuple(_body(body, self._is_drivable(body)) for body in world["bodies"])
        self._hub.world(World(bodies, world["bounds"], world["first"]))

    def _believed(self, view: Any) -> FloatArray | None:
        every: FloatArray = np.asarray(view.odometry).reshape(-1, 3)
        for row, pose in zip(self._world["robots"], every, strict=True):
            if self._rows.get(row) == self._world["first"] and not np.isnan(pose).any():
                return np.asarray(pose)
        return None

    def drives(self) -> dict[str, str | None]:
        """Return the topics of the robots that can be driven; None: the chair, which has a controller of its own."""
        bodies = self._world.get("bodies", [])
        return {body["id"]: body["drive"] for body in bodies if self._is_drivable(body)}

    def _is_drivable(self, body: dict[str, Any]) -> bool:
        return body["drive"] is not None or body["id"] == self._world["first"]

    def _scans(self, view: Any) -> dict[Ranger, Fan]:
        """Return the scans of a view."""
        if not view.stamps:
            return {}
        fans, sensors = self._world["fans"], np.asarray(view.sensors).reshape(-1, 3)
        ends = np.cumsum([0, *(fan["beams"] for fan in fans)])
        scans: dict[Ranger, Fan] = {}
        of_robot: Counter[int] = Counter()
        for number, fan in enumerate(fans):
            place = self._places.get(fan["row"], -1)
            scans[place, of_robot[place]] = _fan(fan, sensors[number], view, slice(ends[number], ends[number + 1]))
            of_robot[place] += 1
        return scans


def _fan(fan: dict[str, Any], sensor: FloatArray, view: Any, part: slice) -> Fan:
    ranges = np.asarray(view.ranges[part])
    with np.errstate(invalid="ignore"):
        error = ranges - view.truths[part] if len(view.truths) else np.zeros(len(ranges), dtype=np.float32)
    error[~np.isfinite(error) | ~np.isfinite(ranges)] = np.nan
    x, y, yaw = sensor.tolist()
    return Fan(
        pose=(x, y, yaw),
        angle_min=fan["angle_min"],
        angle_increment=fan["angle_increment"],
        range_min=fan["range_min"],
        range_max=fan["range_max"],
        ranges=ranges,
        error=error,
        intensities=view.intensities[part],
    )


def _body(body: dict[str, Any], drivable: bool) -> Body:
    """Return a body as a page has it: walls have no pose there, so their outlines are in the world's frame."""
    pose = np.array(body["pose"] if body["kind"] == "wall" else (0.0, 0.0, 0.0))
    polygons = [_moved(pose, polygon) for polygon in body["polygons"]]
    segments = _moved(pose, np.reshape(body["segments"], (-1, 2))).reshape(-1, 4)
    return Body(
        id=body["id"],
        name=body["name"],
        kind=body["kind"],
        color=body["color"],
        movable=body["movable"],
        polygons=tuple(tuple((x, y) for x, y in polygon.tolist()) for polygon in polygons),
        segments=tuple(tuple(ends) for ends in segments.tolist()),
        drivable=drivable,
    )


def _moved(pose: FloatArray, points: Any) -> FloatArray:
    """Return points (k, 2) of a pose's (3,) frame in the world's."""
    flat = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    moved: FloatArray = np.round(compose(pose, np.column_stack([flat, np.zeros(len(flat))]))[:, :2], 4)
    return moved
