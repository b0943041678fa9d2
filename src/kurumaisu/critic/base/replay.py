# SPDX-License-Identifier: BSD-3-Clause
"""Simulate the very run that was measured, with the plant that the simulator runs."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from kurumaisu import effects, geometry
from kurumaisu.critic.base.drive import GRID, Drive, edges_of
from kurumaisu.critic.values.recording import Recording, Series
from kurumaisu.errors import Error
from kurumaisu.params import FOLLOWER, EffectSetting, Model, driven_as, load_model, shipped_robot
from kurumaisu.sim import plant
from kurumaisu.types import FloatArray

_ROOM = 3 * 2**25  # bytes of increments that are kept: for ten minutes of driving, nearly all that are asked for again
_UNUSED = np.random.default_rng(0)  # nothing is drawn: effects that draw are left out
PICTURE = 0.1  # [s] between the poses drawn
# [s] after which a simulated path begins again at the measured pose: the random wander of the heading adds up, and
# after a minute hides what the model does.
RESTART = 10.0


def model_of(recording: Recording, model_file: Path, *, assume_law: bool) -> Model:
    """Return the model that a recording is compared with: of the robot that it names, or that the model file does.

    Where neither does, it is "velocity follows command" if no voltages were recorded and commands ask for more than
    those of the model can say: that is a robot of another make. Else, and where the recording names a model or
    assume_law says that the robot has the model's voltage law, commands become voltages by that law, and rates again:
    the same, until something happens to the voltages.
    Raise Error where voltages of a robot were recorded that has none.
    """
    model = load_model(model_file)
    model = driven_as(model, recording.robot or model.robot)
    volts = [run.name for run in recording.runs if run.voltage is not None]
    if volts and not model.robot.voltages:
        raise Error(
            f"{recording.name}: robot: {model.robot.kind} has no voltages, but voltages of {volts[0]} are given"
        )
    if robot_said(recording, model) or assume_law or recording.model is not None or volts:
        return model
    commands = [run.command for run in recording.runs if run.command is not None]
    return model if all(_sayable(model, command) for command in commands) else driven_as(model, shipped_robot(FOLLOWER))


def robot_said(recording: Recording, model: Model) -> bool:
    """Tell whether the recording, or the file of the model criticised, says which robot it is."""
    return recording.robot is not None or not (model.robot.voltages or model.robot.kind == FOLLOWER)


def _sayable(model: Model, command: Series) -> bool:
    """Tell whether all that is commanded lies within the model's voltages."""
    axes = (("v", model.translation, model.voltages.translation), ("w", model.steering, model.voltages.steering))
    for name, law, channel in axes:
        rates = command.column(name)
        volts = law.volts(rates[np.isfinite(rates)])
        if ((volts < channel.min) | (volts > channel.max)).any():
            return False
    return True


def extend(model: Model, settings: Sequence[EffectSetting]) -> Model:
    """Return the model with these effects in place of its own of the same id."""
    whole = completed(model, settings)
    given = {setting.id for setting in whole}
    return replace(model, effects=(*(own for own in model.effects if own.id not in given), *whole))


def completed(model: Model, settings: Sequence[EffectSetting]) -> tuple[EffectSetting, ...]:
    """Return the effects with every parameter: those that are not given as the model has them, or absent."""
    own = {setting.id: setting.parameters for setting in model.effects}
    whole = []
    for setting in settings:
        parameters = {p.name: p.null for p in effects.by_id(setting.id).parameters}
        whole.append(EffectSetting(setting.id, {**parameters, **own.get(setting.id, {}), **setting.parameters}))
    return tuple(whole)


def motion(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> effects.Motion:
    """Return the motion of the simulated chair on the drive's grid, without random effects."""
    return _driven(drive, model, settings)[1]


def odometry(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) [s] and poses (n, 3) of the simulated chair itself, whatever a reference would see of it."""
    poses = plant.path(_driven(drive, model, settings)[1], np.zeros(3))
    return drive.start + GRID * np.arange(len(poses)), poses


def path(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> FloatArray:
    """Return the simulated reference at its times, (m + 1, 3), starting at the first measured pose."""
    at = measured_poses(drive, model, settings)
    return geometry.compose(drive.poses[0], geometry.between(at[0], at))


def increments(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> FloatArray:
    """Return the simulated body increments between the reference's times, (m, 3)."""
    at = measured_poses(drive, model, settings)
    return geometry.between(at[:-1], at[1:])


class Increments:
    """Simulated body increments of drives by one model: a search asks for many of them again and again."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._known: OrderedDict[Hashable, tuple[Drive, FloatArray]] = OrderedDict()
        self._room = _ROOM

    def of(self, drive: Drive, settings: Sequence[EffectSetting]) -> FloatArray:
        """Return the increments with these effects, (m, 3), not to be written to."""
        whole = ((each.id, tuple(sorted(each.parameters.items()))) for each in completed(self._model, settings))
        key = (id(drive), *whole)
        if key in self._known:
            self._known.move_to_end(key)
            return self._known[key][1]
        found = increments(drive, self._model, settings)
        found.flags.writeable = False
        self._known[key] = drive, found
        self._room -= found.nbytes
        while self._room < 0:
            self._room += self._known.popitem(last=False)[1][1].nbytes
        return found


def measured_poses(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> FloatArray:
    """Return what the reference measures of the simulated chair at its times, (m + 1, 3), in a frame of its own."""
    chair, motion = _driven(drive, model, settings)
    poses = plant.path(motion, np.zeros(3))
    if not chair.effects.reference:
        return drive.at_poses(poses)
    # A clock that runs fast is right at the start, of the drive or of the first one.
    started = drive.known.get(effects.RECORDING_TIME)
    start = 0.0 if started is None else float(started[0])
    curved = any(isinstance(effect, effects.SmoothReference) for effect in chair.effects.reference)
    known = {**motion.known, "v": motion.v, "w": motion.w} if curved else {}
    known = {name: edges_of(values) for name, values in known.items()}
    if any(effect.of_times for effect in chair.effects.reference):
        times = start + GRID * np.arange(len(poses))
        measured = chair.seen(effects.Reference(times, poses, np.zeros_like(poses), start, known))
        return geometry.interpolate(drive.start + (measured.times - start), measured.poses, drive.times)
    at, known = drive.at_poses(poses), {name: drive.at_poses(values) for name, values in known.items()}
    return chair.seen(effects.Reference(start + (drive.times - drive.start), at, np.zeros_like(at), start, known)).poses


def _driven(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> tuple[plant.Plant, effects.Motion]:
    extended = extend(model, settings)
    mean = replace(extended, effects=tuple(own for own in extended.effects if own.id not in _random()))
    chair = plant.Plant(mean, GRID, _UNUSED)
    # The grid begins at the first pose, or a little before it, unless the drive is a part of a longer one.
    heading = float(drive.poses[0, 2]) if drive.heading is None else drive.heading
    return chair, chair.from_rates(drive.v, drive.w, heading, drive.known)


@cache
def _random() -> frozenset[str]:
    return frozenset(effect.id for effect in effects.ALL if effect.random)


def restarted_path(drive: Drive, path: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
    """Yield the pieces of a simulated path (n, 3): rows of the drive's poses, and poses (k, 3) in the map there.

    The last row of a piece is the first of the next: there the one has ended, and the other begins.
    """
    since = drive.times - drive.times[0]
    bounds = np.unique([*np.flatnonzero(np.diff(since // RESTART, prepend=-1.0)), len(since) - 1])
    for a, b in pairwise(bounds.tolist()):
        rows = slice(a, b + 1)
        yield rows, geometry.compose(drive.poses[a], geometry.between(path[a], path[rows]))
