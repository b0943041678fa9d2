# SPDX-License-Identifier: BSD-3-Clause
"""Bumpers, cameras and fiducial finders that the world file has: their readings, model by model."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.schedule import period
from kurumaisu.sim.robots.solids import Solids
from kurumaisu.sim.sensors.bumper import BumperSensor, BumperSettings
from kurumaisu.sim.sensors.camera import CameraSensor, Picture, Scenery, mounted_eye, stage_eye
from kurumaisu.sim.sensors.fiducial import FiducialFinder, Sightings
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world.model import Bumper, Camera, Fiducial, Model

Value = BoolArray | Picture | Sightings  # strips (n,) that touch; a picture; who is seen, all by one finder


@dataclass(frozen=True)
class _Alike:
    """Models with equal devices that are always due together."""

    models: tuple[Model, ...]
    rhythm: tuple[int, int]  # period, and when in it [steps]
    sensor: Any


class WorldDevices:
    """Reads the devices of some types, each at its model's update_interval, as rangers."""

    def __init__(self, machinery: Machinery, types: Sequence[str]) -> None:
        """Prepare the devices of these types. Raise Error for a camera that makes no picture."""
        # Strips feel a cell ahead, as Stage's do by its cells: of a wall beside them they would cross nothing.
        cell = machinery.resolution or 0.0
        self._machinery = machinery
        models = machinery.population.models
        groups: dict[Hashable, list[Model]] = {}
        for model in models:
            if model.type in types and model.device is not None:
                groups.setdefault((_likeness(model), *self._rhythm(model)), []).append(model)
        self._groups = [_Alike(tuple(g), self._rhythm(g[0]), _sensor(g[0], models, cell)) for g in groups.values()]
        felt = any(isinstance(group.sensor, BumperSensor) for group in self._groups)
        self._solids = Solids(machinery) if felt else None
        looked = any(isinstance(group.sensor, CameraSensor) for group in self._groups)
        self._scenery = Scenery(models) if looked else None

    def read(self, step: int) -> dict[int, Value]:
        """Return the readings due in a step, counted from 1, by their models' numbers."""
        due = [group for group in self._groups if step % group.rhythm[0] == group.rhythm[1]]
        if not due:
            return {}
        poses = self._machinery.model_poses()
        return {model.index: value for group in due for model, value in self._read(group, poses)}

    def _read(self, group: _Alike, poses: FloatArray) -> Iterator[tuple[Model, Value]]:
        models = group.models
        places = poses[[model.index for model in models]]
        roots = np.array([model.root for model in models], dtype=np.int64)
        if isinstance(group.sensor, BumperSensor):
            assert self._solids is not None
            return zip(models, group.sensor.read(self._solids.now(), places, roots), strict=True)
        if isinstance(group.sensor, FiducialFinder):
            seen = group.sensor.find(self._machinery.arena, places, roots, poses)
            return zip(models, [seen.of(i) for i in range(len(models))], strict=True)
        return zip(models, [self._picture(group.sensor, model, poses) for model in models], strict=True)

    def _picture(self, sensor: CameraSensor, model: Model, poses: FloatArray) -> Picture:
        assert self._scenery is not None
        assert isinstance(model.device, Camera)
        if self._machinery.dynamics is None and model.parent >= 0:
            eye = stage_eye(model.device, poses[model.parent], poses[model.index])
        else:
            eye = mounted_eye(model.device, poses[model.index])
        return sensor.take(self._scenery, poses, eye, model.root)

    def _rhythm(self, model: Model) -> tuple[int, int]:
        every = period(model.update_interval, self._machinery.interval)
        return every, int(self._machinery.population.born[model.index]) % every


def _likeness(model: Model) -> Hashable:
    """Return what is equal for equal devices."""
    device = model.device
    if isinstance(device, Bumper):
        return device.poses.tobytes(), device.lengths.tobytes()
    assert isinstance(device, (Camera, Fiducial))
    return device


def _sensor(model: Model, models: Sequence[Model], cell: float) -> BumperSensor | CameraSensor | FiducialFinder:
    match model.device:
        case Bumper() as bumper:
            return BumperSensor(BumperSettings(bumper, cell))
        case Camera() as camera:
            return CameraSensor(camera)
        case Fiducial() as fiducial:
            return FiducialFinder(fiducial, models)
    raise AssertionError(f"a {model.type} gives no readings")
