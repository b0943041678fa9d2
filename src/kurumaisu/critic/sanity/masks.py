# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a reference that are off for a moment: they are set aside, and the rest is judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.sanity import imu_match
from kurumaisu.critic.sanity.brief_errors import brief_errors
from kurumaisu.critic.sanity.contacts import TOPIC, contacts
from kurumaisu.critic.sanity.pose_jumps import jumps
from kurumaisu.critic.values.digits import moment, quantities
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import Model
from kurumaisu.types import BoolArray, FloatArray

_BACK = 5.0  # [s] within which a reference that was elsewhere is back
_SAME = 0.5  # share of its first jump that is left when it is back
_MOST = 0.05  # share of a run's rows that may be set aside


def set_aside(recording: Recording, model: Model) -> Recording:
    """Return a recording without what tells nothing of the chair, with notes of that.

    That are rows of its references that are off for a moment, and times in which the chair was held.
    """
    runs, notes = [], []
    for run in recording.runs:
        kept, words = _masked(run, model)
        held = contacts(kept, model)
        turned, odd = imu_match.odd(kept)
        others = {name: series for name, series in kept.covariates.items() if name != TOPIC}
        runs.append(replace(kept, aside=(*kept.aside, *held, *turned), covariates=others))
        notes += [*words, *([_held(kept, held)] if held else []), *([odd] if odd else [])]
    return replace(recording, runs=tuple(runs), problems=(*recording.problems, *notes))


def _held(run: Run, spans: Sequence[tuple[float, float]]) -> str:
    """Return in words when and where a chair was held."""
    (first, end), *more = spans
    place = ""
    if run.pose is not None and len(run.pose.t):
        x, y = (float(np.interp(first, run.pose.t, run.pose.values[:, i])) for i in range(2))
        place = f", at x {x:.2f}, y {y:.2f} m"
    others = f", and {len(more)} times more" if more else ""
    seconds = sum(b - a for a, b in spans)
    return (
        f"{run.name}: the chair is held from t = {moment(first)} to {moment(end)}{place}{others}: a contact? "
        f"{seconds:.1f} s set aside"
    )


def _masked(run: Run, model: Model) -> tuple[Run, list[str]]:
    pose = run.pose
    if pose is None or run.pose_source != "measured":
        return run, []
    spans = _elsewhere(pose, run.command)
    off = np.zeros(len(pose.t), dtype=np.bool_)
    for first, end, _ in spans:
        off[first:end] = True
    if off.mean() > _MOST:
        return run, []
    kept, words = (replace(run, pose=_without(pose, off)), [_told(run.name, pose, spans, off)]) if spans else (run, [])
    assert kept.pose is not None
    brief = brief_errors(kept, model)
    if not brief.any() or brief.mean() > _MOST:
        return kept, words
    begun = moment(float(kept.pose.t[int(np.argmax(brief))]))
    more = f"{run.name}: the reference is off for a moment at t = {begun}: {_rows(brief)}"
    return replace(kept, pose=_without(kept.pose, brief)), [*words, more]


def _elsewhere(pose: Series, command: Series | None) -> list[tuple[int, int, float]]:
    """Return first row, end and distance [m] of each stretch that is off, however it jumps about meanwhile."""
    lasting, single = jumps(pose, 1.0, command)
    jumped = sorted({*lasting, *single})
    step = _beyond_motion(pose, jumped)
    found: list[tuple[int, int, float]] = []
    away, last = 0, 0  # rows at which it left, and jumped last
    off, far = np.zeros(2), 0.0  # how far it is off, and was at most
    for i in jumped:
        if away in single and last == away and i > away + 1 and _alone(pose, away):
            found.append((away, away + 1, far))  # its way back was no jump
            away = 0
        if not away or pose.t[i] - pose.t[away] >= _BACK:
            away, off, far = i, np.zeros(2), 0.0
        off, last = off + step[i - 1], i
        far = max(far, float(np.hypot(*off)))
        if np.hypot(*off) < _SAME * np.hypot(*step[away - 1]):
            found.append((away, i, far))
            away = 0
    if away in single and last == away and away + 1 < len(pose.t) and _alone(pose, away):
        found.append((away, away + 1, far))
    return found


def _beyond_motion(pose: Series, jumped: Sequence[int]) -> FloatArray:
    """Return by how much each row (n - 1, 2) [m] is off the one before, beyond what the rows about jumps move."""
    step, lasts = np.diff(pose.values[:, :2], axis=0), np.diff(pose.t)[:, np.newaxis]
    quiet = np.setdiff1d(np.arange(1, len(pose.t)), jumped)
    if not len(quiet):
        return step
    rates = (step / lasts)[quiet - 1]
    return np.asarray(step - lasts * np.column_stack([np.interp(pose.t[1:], pose.t[quiet], one) for one in rates.T]))


def _alone(pose: Series, row: int) -> bool:
    """Tell whether the row after one that jumped is back where it jumped from."""
    jump, left = pose.values[row : row + 2, :2] - pose.values[row - 1, :2]
    return bool(np.hypot(*left) < _SAME * np.hypot(*jump))


def _without(pose: Series, off: BoolArray) -> Series:
    return Series(pose.t[~off], pose.values[~off], pose.columns)


def _told(name: str, pose: Series, spans: list[tuple[int, int, float]], off: BoolArray) -> str:
    first, end, far = spans[0]
    where = (
        f"t = {moment(float(pose.t[first]))} to {moment(float(pose.t[end - 1]))}"
        if end > first + 1
        else f"t = {moment(float(pose.t[first]))}"
    )
    more = f", and {len(spans) - 1} more" if len(spans) > 1 else ""
    return f"{name}: the reference is {quantities([far], 'm')[0]} off at {where}{more}: {_rows(off)}"


def _rows(off: BoolArray) -> str:
    return f"{int(off.sum())} of its {len(off)} rows set aside ({100 * off.mean():.2g} %)"
