# SPDX-License-Identifier: BSD-3-Clause
"""The fans of beams of a world's rangers, and where on their robots they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.geometry import relative
from kurumaisu.sim.motion.partition import Bodies
from kurumaisu.types import FloatArray
from kurumaisu.world.layout import beam_place
from kurumaisu.world.model import Fan, Model, Ranger


@dataclass(frozen=True)
class RangerFan:
    """One fan of a ranger: its model, its number among the ranger's fans, and the robot it is on, -1: on none.

    body: its number in Bodies, -1: the map's frame. mount (4,): x, y, z [m] of the beams' plane and heading [rad] of
    the fan's middle in the body's frame; bearings (samples,) [rad] about that heading, from -fov/2 to fov/2.
    """

    model: Model
    number: int
    robot: int
    body: int
    fan: Fan
    mount: FloatArray
    bearings: FloatArray


def find(models: Sequence[Model], poses: FloatArray, bodies: Bodies, robots: Sequence[int]) -> tuple[RangerFan, ...]:
    """Return all fans of all rangers, in the order of the models; robots: their bodies' numbers, in order."""
    frames = np.concatenate([poses[bodies.heads], np.zeros((1, 4))])  # the last is the map's
    robot_of = {body: i for i, body in enumerate(robots)}
    found = []
    for model in models:
        if isinstance(model.device, Ranger):
            body = int(bodies.body_of[model.index])
            for number, fan in enumerate(model.device.fans):
                place = beam_place(model, poses[model.index], fan)
                found.append(
                    RangerFan(
                        model, number, robot_of.get(body, -1), body, fan, relative(frames[body], place), bearings(fan)
                    )
                )
    return tuple(found)


def bearings(fan: Fan) -> FloatArray:
    """Return bearings (samples,) [rad]; a single beam looks straight ahead."""
    first, increment = spread(fan)
    return first + increment * np.arange(fan.samples)


def spread(fan: Fan) -> tuple[float, float]:
    """Return the first bearing and the increment [rad]; first and last beams are at the edges of the fan."""
    return (-fan.fov / 2, fan.fov / (fan.samples - 1)) if fan.samples > 1 else (0.0, fan.fov)


def moments(samples: int, sweep: float) -> FloatArray:
    """Return when in a step its beams (samples,) fire, 1 being its end; sweep: share of a step from first to last."""
    return 1.0 - sweep * (1.0 - np.arange(samples) / max(samples - 1, 1))
