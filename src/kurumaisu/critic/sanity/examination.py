# SPDX-License-Identifier: BSD-3-Clause
"""Stage 0: data that are wrong rather than surprising. They are said, with the transform that would mend them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kurumaisu.critic.base.drive import from_voltages
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.ranges.scans.gathering import laser_of, time_zero
from kurumaisu.critic.rates import mean_rates
from kurumaisu.critic.rates.mean_rates import Rates, of_input
from kurumaisu.critic.sanity import (
    headings,
    imu_match,
    input_match,
    map_agreement,
    pose_jumps,
    rows,
    units,
)
from kurumaisu.critic.sanity.headings import Course
from kurumaisu.critic.sanity.input_match import Match
from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.params import Model
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world


def examine(recording: Recording, model: Model) -> Faults:
    """Return what is wrong with the runs to fit and to judge by, in words that begin with the run's name."""
    faults = Faults()
    compared = recording.world is not None and any(run.scan is not None for run in recording.runs)
    segments = load_world(recording.world).segments if compared and recording.world is not None else None
    laser = _mounted(recording, model)
    told = []
    begun = min((run.pose.t[0] for run in recording.runs if run.pose is not None and len(run.pose.t)), default=0.0)
    for run in recording.runs:
        words = _of_run(run, model, first=run.pose is not None and begun in run.pose.t[:1])
        told += [(run, line) for line in [*words, *_of_scans(run, laser, model, None if words else segments)]]
    late = [line.startswith(map_agreement.CLOCKS) for _, line in told]
    if any(late) and laser is not None and segments is not None:
        # A clock that runs fast or slow, which the catalogue has, no run alone can tell.
        runs = [run for run in recording.runs if run.scan is not None]
        both = [(run.scan, run.pose) for run in runs if run.scan and run.pose and run.pose_source == "measured"]
        if map_agreement.drifts(both, laser, segments, _mean_error(model), time_zero(runs)):
            told = [each for each, clock in zip(told, late, strict=True) if not clock]
    for run, line in [*told, *_copies(recording)]:
        faults.add(f"{run.name}: {line}", fatal=True)
    return faults


def _copies(recording: Recording) -> Iterator[tuple[Run, str]]:
    """Yield the runs that are another run once more, with words for it."""
    known: dict[str, set[bytes]] = {}
    for run in recording.runs:
        if run.pose is not None and run.pose_source == "measured":
            own = rows.marks(run.pose)
            other = next((name for name, earlier in known.items() if rows.copied(own, earlier)), None)
            if other is not None:
                yield run, f"has the poses of {other}, to the last bit: a copy; leave one of them out"
            known[run.name] = own


def _mounted(recording: Recording, model: Model) -> LaserMount | None:
    """Return the laser of the recording, else the model's; None where its fan cannot be that of the scans."""
    laser = laser_of(model.laser, recording.laser, recording.runs)
    if recording.laser is None and any(run.scan.values.shape[1] != laser.beams for run in recording.runs if run.scan):
        return None
    place = laser.mount
    return LaserMount(place.x, place.y, place.yaw, laser.angle_min, laser.angle_increment, laser.beams)


def _of_scans(run: Run, laser: LaserMount | None, model: Model, segments: FloatArray | None) -> list[str]:
    """Return what is wrong with scans; segments (m, 4) of the map [m], None to leave it out."""
    if run.scan is None or len(run.scan.t) < 2:
        return []
    words = rows.problems(run.scan, run.pose, laser, model.laser.range_max)
    if words or laser is None or segments is None or run.pose is None or run.pose_source != "measured":
        return words
    return _one(map_agreement.problem(run.scan, run.pose, laser, segments, _mean_error(model)))


def _mean_error(model: Model) -> FloatArray:
    """Return slope and offset [m] of a reading of a range."""
    ends = model.laser.error.mean(np.array([0.0, 1.0]))
    return np.array([ends[1] - ends[0], ends[0]])


def _of_run(run: Run, model: Model, *, first: bool) -> list[str]:
    """Return what is wrong with a run, in words; first: of all drives."""
    wrong = units.untimely(run) or units.endless(run)
    if wrong or run.pose is None or len(run.pose.t) < 3:
        return wrong
    found = headings.course(run.pose)
    pose = _mended(run.pose, found)
    parts = (("command", run.command), ("voltage", run.voltage), ("odometry", run.odom))
    there = [(name, part) for name, part in parts if part is not None and len(part.t) > 1]
    inputs = [(name, part, rates) for name, part in there if (rates := _rates(part, pose)) is not None]
    known, lawful, follows = [], True, dict[str, FloatArray]()
    for name, _, rates in inputs:
        asked = rates[0]
        if name == "voltage":
            t, v, w = from_voltages(run, model)
            asked = of_input(t, np.column_stack([v, w]), rates[1].t)
        plain = input_match.compare(asked, rates[1], name, first=first)
        match = units.match(run, name, plain, rates[1], model) if name != "odometry" else plain
        known.append((name, match, _number(*rates)))
        follows[name] = plain.correlation
        lawful &= match is plain
    words = _one(headings.heading_words(found, *_agreement(found.factor, known))) if found is not None else []
    words += [*pose_jumps.problems(run.pose, pose_jumps.asked(run, model)), *_one(rows.blocks(run.pose, "pose"))]
    words += _one(headings.folded(run.pose))
    words += [] if found is not None and not found.right else imu_match.problems(run)
    # Poses that were worked out repeat themselves at rest, to the last bit; measured ones never do.
    measured = run.pose_source == "measured"
    words += _one(pose_jumps.problem(run.pose)) if measured else []
    told = [
        line
        for name, part, rates in inputs
        for line in _against(name, part, pose if measured else None, rates, model, follows[name])
    ]
    for name, match, number in known:
        signs = input_match.sign_and_unit(match, number, name)
        told += [*match.words, *(signs or input_match.unrelated(match, number, name))]
    # Of poses that are mirrored every input seems to have the wrong sign; by another law some voltages have.
    reflected = found is not None and found.factor < 0
    words += [line for line in told if not ((reflected or not lawful) and "wrong sign" in line)]
    return list(dict.fromkeys(words))


def _one(words: str | None) -> list[str]:
    return [] if words is None else [words]


def _against(
    name: str, part: Series, pose: Series | None, rates: tuple[Rates, Rates], model: Model, follows: FloatArray
) -> list[str]:
    """Return what is wrong with an input, or with measured poses in its light; follows: as volts have it."""
    words = units.problems(part, rates[1], model, follows) if name == "voltage" else []
    if pose is None:
        return words
    for check in (rows.repeated(pose, rates[1]), rows.frozen(pose, rates[0]), rows.coarse(pose, rates[1])):
        words += _one(check)
    return words


def _mended(pose: Series, found: Course | None) -> Series:
    """Return the poses with the heading that their course suggests."""
    if found is None or found.right or found.agreement < 0.85:
        return pose
    values = pose.values.copy()
    values[:, 2] = found.factor * values[:, 2] + found.offset
    return replace(pose, values=values)


def _rates(part: Series, pose: Series) -> tuple[Rates, Rates] | None:
    """Return what was asked for and what was driven on one grid, None where there is too little of both."""
    t = mean_rates.grid(min(part.t[0], pose.t[0]), max(part.t[-1], pose.t[-1]))
    if len(t) < 100:
        return None
    by_poses = "theta" in part.columns
    asked = mean_rates.of_poses(part, t) if by_poses else mean_rates.of_input(part.t, part.values[:, :2], t)
    if by_poses:
        asked.values[(t < part.t[0]) | (t > part.t[-1])] = np.nan
    driven = mean_rates.of_poses(pose, t)
    driven.values[(t < pose.t[0]) | (t > pose.t[-1])] = np.nan
    return (asked, driven) if _number(asked, driven) >= 8 else None


def _number(asked: Rates, driven: Rates) -> float:
    """Return how many independent samples both have in common."""
    known = np.isfinite(asked.values + driven.values).all(axis=1)
    return float(known.sum() * mean_rates.STEP / mean_rates.SPAN)


def _agreement(factor: float, known: list[tuple[str, Match, float]]) -> tuple[bool | None, bool | None]:
    """Return whether the heading as given turns, and the robot goes ahead, as the first input asks for."""
    for _, match, _ in known:
        ahead, turns = (bool(c > 0) if abs(c) > 0.5 else None for c in match.correlation)
        return (turns if turns is None or factor > 0 else not turns), ahead
    return None, None
