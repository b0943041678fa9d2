# SPDX-License-Identifier: BSD-3-Clause
"""Where the chair drives: walls, what can be pushed, who else is there, and the chair among them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, cast

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.geometry import PLANAR, attached, between, relative
from kurumaisu.params import Chassis
from kurumaisu.sim.chair.body import Scene, outline
from kurumaisu.sim.motion.following import Followed
from kurumaisu.sim.motion.partition import Distort, is_robot
from kurumaisu.sim.options import OdometryWalk, Options
from kurumaisu.sim.robots import snapshot
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.model_changes import checked_pose, moved, rebuilt, with_newcomers, without
from kurumaisu.sim.robots.population import Population
from kurumaisu.sim.robots.touch import touched
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Model

_STILL = OdometryWalk(distance=0.0, heading_per_metre=0.0, heading_per_radian=0.0)
# The rest of the simulator's options is about robots with odometry and rangers of their own.
_OPTIONS = Options(
    semantics="physical",
    collision="exact",
    ray_casting="exact",
    timing="consistent",
    threads=1,
    limit_acceleration=False,
    scan_sweep=0.0,
    odometry_walk=_STILL,
    devices=(),
    effects=(),
)


class ChairWorld:
    """A world in motion, of which one robot, the chair, is driven by its plant."""

    def __init__(self, scene: Scene, chassis: Chassis, dynamics: Dynamics, distort: Distort | None) -> None:
        """Put everything where it begins; distort: says where the walls are in truth."""
        self._dynamics = dynamics
        self.step = dynamics.contacts.step
        self._corners = outline(chassis)
        self._chair_key = scene.chair
        self._distort = distort
        self._have(self._machine(Population.first(scene.models, scene.poses)))
        self.begin()

    def begin(self) -> None:
        """Put everything back to where it began, at rest."""
        self._have(self._home)
        machinery = self.machinery
        machinery.place(machinery.population.poses[machinery.bodies.heads])
        machinery.begin(0)
        self.pose = machinery.frames[self.body, PLANAR]

    def drive(self, v: float, w: float, u: float) -> tuple[FloatArray, bool]:
        """Move all for a step; the motors want v forward, u leftward [m/s], w [rad/s].

        Return the chair's mean rates (3,): forward, leftward [m/s], yaw [rad/s]; and if an obstacle limited them.
        """
        machinery, before = self.machinery, self.pose
        machinery.drive.velocities[self.robot] = v, u, w
        wheels = machinery.wheels()
        free = self.alone and self._glide(wheels)
        if not free:
            machinery.move()
        self._look()
        if free or not machinery.stalled[self.body]:
            return wheels[self.robot].copy(), False
        return between(before, self.pose) / self.step, True

    def command(self, robot: str, velocity: FloatArray) -> None:
        """Let another robot drive on at forward, leftward [m/s], turn [rad/s] (3,), as its world file bounds it.

        Raise Error for an unknown robot, the chair, or what is not finite.
        """
        machinery = self.machinery
        index = machinery.population.index(robot)
        rows = [row for row, model in enumerate(machinery.robots) if model.index == index and row != self.robot]
        if not rows or not np.isfinite(velocity).all():
            raise Error(f"{robot}: no other robot, or not finite: {np.asarray(velocity).tolist()}")
        commands = np.zeros((len(machinery.robots), 3))
        commands[rows] = velocity
        machinery.drive.update(commands, np.array(rows))

    def set_pose(self, name: str, pose: FloatArray) -> None:
        """Put a model, with all that stands on it, to a pose (4,). Raise Error for an unknown one.

        Raise Error as well for a pose of the chair where it does not fit; then nothing has changed.
        """
        machinery = self.machinery
        index = machinery.population.index(name)
        before = machinery.frames[self.body].copy()
        self._have(moved(machinery, index, checked_pose(pose)))
        if index == self.chair:
            if self.overlaps():
                why = ", ".join(self._in_the_way()) or "something"
                moved(self.machinery, index, before)
                x, y, _, heading = pose
                place = f"x {x:.3f} m, y {y:.3f} m, {math.degrees(heading):.1f} deg"
                raise Error(f"{name}: does not fit at {place}; in the way: {why}")
            self.pose = self.machinery.frames[self.body, PLANAR]

    def spawn(self, models: Sequence[Model], pose: FloatArray, step: int) -> str:
        """Add a tree of models, parents first, the first one at a pose (4,); return `#` and its key.

        Raise Error, with nothing changed, for a robot, and if the chair is in the way.
        """
        if any(is_robot(model) for model in models):
            raise Error(f"{models[0].name or models[0].type}: a robot cannot come to a world that runs")
        before = self.machinery.population
        self._go_on_with(with_newcomers(before, models, checked_pose(pose), step))
        return f"#{before.fresh}"

    def delete(self, name: str) -> None:
        """Take a model with all that stands on it away. Raise Error, with nothing changed, for a robot."""
        machinery = self.machinery
        index = machinery.population.index(name)
        if any(is_robot(machinery.population.models[i]) for i in machinery.population.with_descendants(index)):
            raise Error(f"{name}: a robot cannot leave a world that runs")
        self._go_on_with(without(machinery, index).population)

    def restore_model(self, name: str, step: int) -> None:
        """Bring back what was deleted. Raise Error, with nothing changed, if it cannot be."""
        self._go_on_with(self.machinery.population.restored(name, step))

    def _go_on_with(self, population: Population) -> None:
        before = self.machinery
        after = rebuilt(before, population)
        if self._distort is not None and len(after.walls.faces) != len(before.walls.faces):
            raise Error("world.map_error acts, and would move all walls anew: switch it off first")
        self._have(after)
        if self.overlaps():
            why = ", ".join(self._in_the_way())
            self._have(before)
            raise Error(f"the chair is in the way: it would overlap {why}")

    def overlaps(self) -> bool:
        """Return whether the chair touches something solid, or something solid is inside of it."""
        machinery = self.machinery
        return bool(machinery.arena.touches(machinery.numbers[self.body : self.body + 1])[0]) or any(self._held())

    def state(self) -> dict[str, Any]:
        """Return all that changes."""
        machinery = self.machinery
        changed = machinery.population if machinery is not self._home else None
        return {"population": changed, "machinery": snapshot.take(machinery), "pose": self.pose.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a state of the same world."""
        population = state["population"]
        self._have(self._home if population is None else self._machine(population))
        snapshot.restore(self.machinery, state["machinery"])
        self.pose = state["pose"]

    def _machine(self, population: Population) -> Machinery:
        return Machinery(population, _OPTIONS, self.step, self._dynamics, self._distort)

    def _have(self, machinery: Machinery) -> None:
        """Go on with machinery that is new, or the old one changed."""
        if not hasattr(self, "_home"):
            self._home = machinery
        self.machinery = machinery
        self.chair = int(np.flatnonzero(machinery.population.keys == self._chair_key)[0])
        self.tree = machinery.population.models[self.chair].root
        self.body = int(machinery.bodies.body_of[self.chair])
        self.robot = int(np.flatnonzero(machinery.robot_rows == self.body)[0])
        self.alone = len(machinery.bodies) == 1
        self._motion = cast(Followed, machinery.motion)

    def _glide(self, wheels: FloatArray) -> bool:
        """Move the chair, which alone can move, if nothing is in its way; the arena need not know: it sees no other."""
        machinery = self.machinery
        poses = self._motion.glide(wheels, self.step)
        if poses is None:
            return False
        machinery.before, machinery.frames = machinery.frames, machinery.before
        machinery.frames[0] = poses[0]
        machinery.stalled[0] = False
        return True

    def _look(self) -> None:
        """Note where the chair is; its heading goes on beyond a turn."""
        x, y, _, heading = self.machinery.frames[self.body].tolist()
        known = float(self.pose[2])
        self.pose = np.array([x, y, known + math.remainder(heading - known, math.tau)])

    def _in_the_way(self) -> list[str]:
        """Return the names of what the chair overlaps; walls that effects have moved have none."""
        machinery = self.machinery
        models = [*touched(machinery, self.body), *self._held()]
        return list(dict.fromkeys(model.name or f"a {model.type}" for model in models))

    def _held(self) -> Iterator[Model]:
        """Yield what is solid and has a corner, of the chair's heights, inside of the chair."""
        machinery = self.machinery
        frame = machinery.frames[self.body]
        model = machinery.population.models[self.chair]
        low, high = frame[2], frame[2] + model.size[2]
        for other, pose in zip(machinery.population.models, machinery.model_poses(), strict=True):
            if other.obstacle_return and other.index != self.chair:
                z = other.shape.heights + pose[2]
                ends = other.shape.segments[(z[:, 0] <= high) & (z[:, 1] >= low)].reshape(-1, 2)
                corners = np.hstack([ends, np.zeros((len(ends), 2))])
                seen = relative(frame, attached(pose, corners))[:, :2]
                if ((seen > self._corners.min(axis=0)) & (seen < self._corners.max(axis=0))).all(axis=1).any():
                    yield other
