# SPDX-License-Identifier: BSD-3-Clause
"""Effects on the robots of a world: between command and motion, on their rangers, on what a reference measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kurumaisu._core import Arena, AxisLaw
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.params import EffectSetting, identity_law
from kurumaisu.sim.memory import recall, remember
from kurumaisu.sim.options import ALL_ROBOTS, Options, RobotEffects
from kurumaisu.sim.rangers.fans import RangerFan
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Model

if TYPE_CHECKING:  # loaded below by those that have any
    from kurumaisu.effects import Reference
    from kurumaisu.sim.plant import Plant
    from kurumaisu.sim.rangers.fan_effects import FanEffects

_STREAM = 3  # of a seed's; those before it are the simulator's own


@dataclass(frozen=True)
class _Follower:
    """A robot without a voltage law of its own: 1 V stands for 1 m/s and 1 rad/s, without a dead zone."""

    effects: tuple[EffectSetting, ...]
    translation: AxisLaw
    steering: AxisLaw


class FleetEffects:
    """The effects that act on the robots of a population; every robot and fan draws from a stream of its own."""

    def __init__(self, options: Options, robots: Sequence[Model], keys: IntArray, step: float) -> None:
        """Note which effects robots have; keys (n,): what they are known by for life; step [s] of the world."""
        self._chosen = [_of(robot, options.effects) for robot in robots]
        self._sweep = options.scan_sweep / step
        self._keys = keys.tolist()
        self._step = step
        self._plants: dict[int, Plant] = {}  # by the robots' rows
        self._fans: dict[int, FanEffects] = {}  # by their places among the fans
        self._fan_keys: dict[int, str] = {}
        self._seed = 0

    def begin(self, seed: int) -> None:
        """Start the robots' effects anew."""
        self._seed = seed
        self._plants = {}
        if any(self._chosen):
            from kurumaisu.effects import BaseEffect
            from kurumaisu.sim.plant import Plant

            law = identity_law()
            self._plants = {
                row: Plant(_Follower(chosen, law, law), self._step, self._stream(row, 0))
                for row, chosen in enumerate(self._chosen)
                if _any_of(BaseEffect, chosen)
            }
        self.referred = any(plant.effects.reference for plant in self._plants.values())

    def begin_fans(self, fans: Sequence[RangerFan], keys: IntArray, arena: Arena) -> dict[int, FanEffects]:
        """Start the fans' effects anew and return them; keys (models,): what the models are known by for life."""
        self._fans, self._fan_keys = {}, {}
        if not any(self._chosen):
            return self._fans
        from kurumaisu.effects import LaserEffect, build_laser
        from kurumaisu.sim.rangers.fan_effects import FanEffects

        for place, fan in enumerate(fans):
            if fan.robot < 0 or not _any_of(LaserEffect, self._chosen[fan.robot]):
                continue
            key = int(keys[fan.model.index])
            rng = self._stream(fan.robot, 1 + key, fan.number)
            chain = build_laser(self._chosen[fan.robot], rng)
            self._fans[place] = FanEffects(fan, chain, rng, arena, self._step, self._sweep)
            self._fan_keys[place] = f"{key}.{fan.number}"
        return self._fans

    @property
    def moves(self) -> bool:
        """Whether some robot does not move as it is commanded."""
        return bool(self._plants)

    def driven(self, velocities: FloatArray, poses: FloatArray) -> FloatArray:
        """Return how robots at poses (n, 4) in the map move when commanded velocities (n, 3).

        A leftward speed that is commanded stays as it is.
        """
        driven = velocities.copy()
        for row, plant in self._plants.items():
            v, u, w = velocities[row]
            x, y, _, heading = poses[row]
            motion = plant.from_rates(np.array([v]), np.array([w]), float(heading), {"x": x, "y": y})
            slip = 0.0 if motion.u is None else float(motion.u[0])
            driven[row] = motion.v[0], u + slip, motion.w[0]
        return driven

    def seen(self, time: float, poses: FloatArray, rates: FloatArray) -> Reference:
        """Return what a reference measures of robots at poses, with rates (n, 3)."""
        from kurumaisu.effects import Reference

        times, poses, rates = np.full(len(poses), time), poses.copy(), rates.copy()
        for row, plant in self._plants.items():
            one = plant.seen(Reference(np.array(time), poses[row], rates[row]))
            times[row], poses[row], rates[row] = one.times, one.poses, one.rates
        return Reference(times, poses, rates)

    def state(self) -> dict[str, Any]:
        """Return what the effects remember, copies."""
        return {
            "robots": {self._keys[row]: remember(plant) for row, plant in self._plants.items()},
            "fans": {self._fan_keys[place]: fan.state() for place, fan in self._fans.items()},
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a state, as far as its robots are still here."""
        for row, plant in self._plants.items():
            if self._keys[row] in state["robots"]:
                recall(plant, state["robots"][self._keys[row]])
        for place, fan in self._fans.items():
            if self._fan_keys[place] in state["fans"]:
                fan.restore(state["fans"][self._fan_keys[place]])

    def _stream(self, row: int, *part: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=(_STREAM, self._keys[row], *part)))


def check_names(entries: Sequence[RobotEffects], robots: Sequence[Model]) -> None:
    """Raise Error for an entry whose robot the world has not, and for an effect that a robot would have twice."""
    names = [robot.name for robot in robots if robot.name]
    for entry in entries:
        if entry.robot != ALL_ROBOTS and entry.robot not in names:
            near = hint(entry.robot, names)
            raise Error(f"effects: robot: the world has no position of this name: {entry.robot}; {near}")
    if entries:
        from kurumaisu.effects import check

        for robot in robots:
            check(_of(robot, entries))


def _of(robot: Model, entries: Sequence[RobotEffects]) -> tuple[EffectSetting, ...]:
    return tuple(effect for entry in entries if entry.robot in (ALL_ROBOTS, robot.name) for effect in entry.effects)


def _any_of(kind: type[Any], chosen: Sequence[EffectSetting]) -> bool:
    from kurumaisu.effects import by_id

    return any(issubclass(by_id(effect.id), kind) for effect in chosen)
