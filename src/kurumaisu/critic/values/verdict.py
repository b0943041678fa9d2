# SPDX-License-Identifier: BSD-3-Clause
"""The critic's answer as values, and verdict.json: written against verdict.schema.json."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import jsonschema

from kurumaisu.errors import Error

SCHEMA_VERSION = 1
Kind = Literal["none", "named", "confounded", "unknown", "invalid_data"]

NORMAL90 = 1.645  # half width of a 90 % interval, in standard deviations


@dataclass(frozen=True)
class Estimate:
    """A parameter and its 90 % interval, in its own unit."""

    estimate: float
    lo90: float
    hi90: float
    unit: str


@dataclass(frozen=True)
class Cause:
    """One effect of the catalogue: its id, probability, parameters, and log evidence over its absence."""

    id: str
    p: float
    parameters: dict[str, Estimate]
    gain_nats: float


@dataclass(frozen=True)
class Unknown:
    """A misfit outside the catalogue: where it shows, what it follows, shape, probability."""

    channel: str
    covariate: str
    shape: str
    p: float


@dataclass(frozen=True)
class NextExperiment:
    """The drive that would tell most: id, duration [s], expected log evidence, what it separates."""

    id: str
    seconds: float
    expected_nats: float
    separates: tuple[str, ...]


@dataclass(frozen=True)
class LogDensityGain:
    """Held-out log predictive density per sample [nat], of both models; gain with its 90 % interval."""

    baseline: float
    extended: float
    gain: float
    lo90: float
    hi90: float


@dataclass(frozen=True)
class RmseGain:
    """Held-out root mean square error of both models; gain = baseline - extended with its 90 % interval.

    achievable: what noise alone leaves to a model without fault; None where that is not known.
    """

    baseline: float
    extended: float
    gain: float
    lo90: float
    hi90: float
    unit: str
    achievable: float | None = None


@dataclass(frozen=True)
class ChannelGain:
    """The same of one channel; rmse: None where no error could be measured."""

    log_density_per_sample: LogDensityGain
    rmse: RmseGain | None = None


@dataclass(frozen=True)
class SlamGain:
    """A map and path made from one run's scans, with the odometry and laser of either model.

    Root mean square errors of the path against the reference, aligned; run: the one held out; scans: how many.
    """

    run: str
    scans: int
    position: RmseGain
    heading: RmseGain


@dataclass(frozen=True)
class Gain:
    """What the extension is worth on data that it did not fit. rmse: by what is predicted, in words.

    log_density_per_sample: of the base, a sample being an increment; where nothing was found in the base, of the
    laser, a sample being a reading. channels: dx, dy (given dx), dtheta (given both) and range, as far as measured.
    slam: None where it was not run.
    """

    log_density_per_sample: LogDensityGain
    rmse: dict[str, RmseGain] = field(default_factory=dict)
    channels: dict[str, ChannelGain] = field(default_factory=dict)
    slam: SlamGain | None = None


@dataclass(frozen=True)
class Multipliers:
    """What ROS's diff_drive_controller takes for what was named.

    wheel_radius_multiplier: of both wheels; where it is given, the controller does not look for the left and the right
    one. apparent_track: distance of wheels [m] that would turn the robot as it turns. square_before, square_after: how
    far the robot is from its start [m] after UMBmark's square, the worse of both directions, without and with them.
    """

    wheel_separation_multiplier: Estimate
    wheel_radius_multiplier: Estimate
    left_wheel_radius_multiplier: Estimate
    right_wheel_radius_multiplier: Estimate
    apparent_track: Estimate
    square_before: float
    square_after: float


@dataclass(frozen=True)
class RobotTaken:
    """The robot that a recording was taken to be of, by its file in launch/robots/; assumed: nothing said so."""

    kind: str
    assumed: bool
    multipliers: Multipliers | None = None


@dataclass(frozen=True)
class Verdict:
    """The critic's answer. gain is None where nothing could be held out or simulated."""

    verdict: Kind
    causes: tuple[Cause, ...] = ()
    confounded: tuple[tuple[str, ...], ...] = ()
    unknown: tuple[Unknown, ...] = ()
    problems: tuple[str, ...] = ()
    next_experiment: NextExperiment | None = None
    gain: Gain | None = None
    robot: RobotTaken | None = None


def to_json(verdict: Verdict) -> dict[str, Any]:
    """Return the content of verdict.json.

    Raise Error naming the field for a number that is not finite or anything the schema forbids.
    """
    content = {"schema": SCHEMA_VERSION, **json.loads(json.dumps(asdict(verdict)))}
    _check(content)
    return content


def verdict_text(verdict: Verdict) -> str:
    """Return the text of verdict.json. Raise Error where to_json does."""
    return json.dumps(to_json(verdict), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _check(content: Any) -> None:
    for name, part in _parts(content, ""):
        if isinstance(part, float) and not math.isfinite(part):
            raise Error(f"verdict: {name}: must be a finite number: {part}")
    schema = json.loads(Path(__file__).with_name("verdict.schema.json").read_text(encoding="utf-8"))
    fault = jsonschema.exceptions.best_match(jsonschema.Draft202012Validator(schema).iter_errors(content))
    if fault is not None:
        raise Error(f"verdict: {'.'.join(map(str, fault.absolute_path)) or 'the file'}: {fault.message}")
    for name, part in _parts(content, ""):
        if isinstance(part, dict) and "lo90" in part and part["lo90"] > part["hi90"]:
            raise Error(f"verdict: {name}: lo90 {part['lo90']:g} is above hi90 {part['hi90']:g}")


def _parts(content: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield all that there is in JSON, with its name."""
    yield name, content
    members = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in members:
        yield from _parts(value, f"{name}.{key}".lstrip("."))


def grouped(problems: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return problems that differ only in their runs and numbers under one heading, with what each says."""
    groups: dict[str, list[str]] = {}
    for problem in problems:
        where, _, what = problem.partition(": ")
        kind = what.partition(" (first")[0].partition(": ")[0]
        groups.setdefault(kind or where, []).append(problem)
    return list(groups.items())
