# SPDX-License-Identifier: BSD-3-Clause
"""The critic beside what else calibrates a robot: UMBmark's formulas, and plain least squares."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from kurumaisu.bench.critic import least_squares, squares
from kurumaisu.bench.critic.least_squares import Inputs
from kurumaisu.bench.table import Table
from kurumaisu.critic import pipeline
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive, prepare
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.excerpt import Excerpt, Moment, cut, span
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import Multipliers
from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.params import Robot, robot_of, shipped
from kurumaisu.settings import Section
from kurumaisu.types import FloatArray

_MODEL = "launch/md100.yaml"
_Result = TypeVar("_Result")
_AFTER = (5.0, 20.0)  # [s]
# Public recordings (docs/peers.md), and what is said of their robots; odometry in metres needs no radius.
_KNOWN: dict[str, dict[str, object]] = {
    "create_r5": {"kind": "velocity"},
    "create_r3": {"kind": "velocity"},
    "lego_camera": {"kind": "diff_drive", "radius": 0.03, "track": 0.15},
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print errors on data held out for each recording that is there, and a table of simulated squares."""
    parser = argparse.ArgumentParser(prog="scripts/bench peers", description=__doc__)
    parser.add_argument("--recordings", type=Path, metavar="FOLDER", help=f"holds {', '.join(_KNOWN)}, or some of them")
    parser.add_argument("--fit", type=float, default=60.0, help="seconds of each that are fitted; twice as many judge")
    parser.add_argument("--draws", type=int, default=3, help="robots that drive UMBmark's square")
    options = parser.parse_args(arguments)
    for name in _KNOWN:
        path = None if options.recordings is None else options.recordings / name
        if path is None or not path.exists():
            print(f"{name}: skipped, as it is not there: --recordings FOLDER says where it is")
            continue
        _compare(path, options.fit, robot_of(Section({"robot": _KNOWN[name]}, name)))
    if options.draws > 0:
        squares.compare(options.draws, _multipliers)
    return 0


def _compare(path: Path, seconds: float, robot: Robot) -> None:
    """Print a table of errors on the part of a recording that was not fitted."""
    whole = read_recording(path)
    first, last = span(whole.runs[0])
    seconds = min(seconds, (last - first) / 2)
    parts = [
        cut(whole.runs[0], Excerpt(Moment(a), Moment(b)), Faults())
        for a, b in ((first, first + seconds), (first + seconds, min(last, first + 3 * seconds)))
    ]
    recording = replace(whole, runs=(parts[0],), train=(parts[0].name,), robot=robot)
    model = replay.model_of(recording, shipped(_MODEL), assume_law=False)
    drives = [prepare(part, model) for part in parts]
    judged = _inputs(drives[1])
    heads = [
        f"{what} after {t:g} s [{unit}]" for t in _AFTER for what, unit in (("position", "mm"), ("heading", "deg"))
    ]
    title = f"{path.name}: {seconds:.0f} s fitted, the {judged.times[-1] - judged.times[0]:.0f} s after them held out"
    table = Table(title, "method", *heads, "CPU [s]")
    table.row("nothing fitted", *_errors(judged, replay.path(drives[1], model, ())), "-")
    values, took = _timed(lambda: least_squares.fitted([_inputs(drives[0])]))
    table.row("least squares, 6 parameters", *_errors(judged, least_squares.path(judged, values)), took)
    try:
        found, took = _timed(lambda: _criticised(recording))
    except Error as error:
        table.note(f"the critic: {error}")
        return
    table.row("the critic", *_errors(judged, replay.path(drives[1], model, found.settings)), took)
    taken = found.verdict.robot
    if taken is not None and taken.multipliers is not None and robot.track is not None:
        m = taken.multipliers
        ahead, apart = m.wheel_radius_multiplier.estimate, m.wheel_separation_multiplier.estimate
        curve = (
            (m.right_wheel_radius_multiplier.estimate - m.left_wheel_radius_multiplier.estimate) / robot.track / apart
        )
        wheels = np.array([ahead, ahead / apart, curve / ahead, 0.0, 0.0, 0.0])
        table.row("the critic's multipliers alone", *_errors(judged, least_squares.path(judged, wheels)), "-")
    names = ("gain v", "gain w", "turn per metre", "lag v", "lag w", "delay")
    told = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, values, strict=True))
    table.note(
        f"least squares: {told}. The critic: {_words(found)}. UMBmark does not apply: no squares in both directions."
    )


def _multipliers(recording: Recording) -> Multipliers | None:
    robot = _criticised(recording).verdict.robot
    return None if robot is None else robot.multipliers


def _criticised(recording: Recording) -> Criticism:
    return pipeline.criticise(recording, shipped(_MODEL), lambda _: None)


def _words(found: Criticism) -> str:
    return f"{found.verdict.verdict}: {', '.join(setting.id for setting in found.settings)}"


def _timed(work: Callable[[], _Result]) -> tuple[_Result, float]:
    begun = time.process_time()
    return work(), time.process_time() - begun


def _inputs(drive: Drive) -> Inputs:
    return Inputs(drive.start, GRID, drive.v, drive.w, drive.times, drive.poses)


def _errors(judged: Inputs, path: FloatArray) -> list[float]:
    """Return rms errors of position [mm] and heading [deg] after each time."""
    out = []
    for seconds in _AFTER:
        rows = least_squares.ahead(judged.times, seconds)
        off = least_squares.moved(path, rows) - least_squares.moved(judged.poses, rows)
        turned = wrap(off[:, 2])
        out += [1000 * float(np.sqrt(np.mean(off[:, 0] ** 2 + off[:, 1] ** 2)))]
        out += [float(np.degrees(np.sqrt(np.mean(turned**2))))]
    return out
